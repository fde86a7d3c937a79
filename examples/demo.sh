#!/bin/sh
# The whole campaign on the virtual manutec-r15, into a folder of its own: nothing is overwritten.
# Usage: examples/demo.sh [path of hil]
set -eu
hil=${1:-hil}

step() {
    printf '\n$ hil %s\n' "$*"
    "$hil" "$@"
}

name=demo
number=1
while [ -e "runs/$name" ] || [ -e "runs/$name.plan.yaml" ]; do
    number=$((number + 1))
    name=demo-$number
done
mkdir -p runs
plan=runs/$name.plan.yaml
run=runs/$name

step plan manutec-r15 -o "$plan"
step dry-run "$plan"
step run "$plan" -o "$run"
step identify "$run"
step report "$run"
step validate "$run" --truth sim_plant/plants/manutec-r15.yaml

printf '\nreport  %s/report.html\nmodel   %s/model.yaml\n' "$run" "$run"
