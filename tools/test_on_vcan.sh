#!/bin/sh
# The tests that need a vcan0: here where there is one, else in a QEMU guest, else not at all, with
# the reason. Debian's packages that are missing are installed where that is allowed.
cd "$(dirname "$0")/.." || exit 1
missing=
for pair in qemu-system-x86_64:qemu-system-x86 candump:can-utils tshark:tshark; do
	command -v "${pair%%:*}" >/dev/null || missing="$missing ${pair#*:}"
done
if [ -n "$missing" ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
	{
		apt-get update -qq &&
			# shellcheck disable=SC2086 # one word a package
			DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing
	} </dev/null >/dev/null 2>&1 || echo "cannot install$missing"
fi

# Compiled code is cached for one kind of processor; the guest's is another, so any will do for both.
# Plug-ins and fixtures that these tests do not need would take the guest half a minute.
export NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= PYTEST_DISABLE_PLUGIN_AUTOLOAD=1
tests='.venv/bin/pytest --noconftest -p pytest_rerunfailures tests/drivers/test_real_time.py -rs'
if [ -e /sys/class/net/vcan0 ]; then
	exec $tests -k vcan
fi
scratch=$(mktemp -d) # a run in one process, for what it compiles
trap 'rm -rf "$scratch"' EXIT
{
	.venv/bin/hil plan manutec-r15 -o "$scratch/plan.yaml" --gravity 8 --inertia 20 --coupling 2 &&
		.venv/bin/hil run "$scratch/plan.yaml" -o "$scratch/run"
} >/dev/null || exit
.venv/bin/python tools/can_guest.py --timeout 600 $tests -k vcan
status=$?
case "$status" in
69) echo 'SKIPPED the tests on vcan: there is neither a vcan0 nor a guest that has one' ;;
70 | 124) echo 'SKIPPED the rest of the tests on vcan: the guest died or is too slow on this machine' ;;
*) exit "$status" ;;
esac
