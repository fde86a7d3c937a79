#!/usr/bin/env bash
# python-can 4.6.1: a TRC log returns every frame on the next bus.
#
# Input: frames of two buses, channel 0 (left arm) and channel 1 (right arm),
# with the same identifiers on both, as two arms of one type have; logged to
# TRC, ASC and BLF and read back.
#
# Expected: channels 0 and 1, as ASC and BLF return them. Their files count
# buses from 1 as well, and their readers take the 1 away that the writers add.
#
# Seen: TRC returns channels 1 and 2. A filter on channel 1 finds the left arm
# where the right one is expected, and channel 0 is empty; a replay by channel
# sends the frames of the left arm to the right one. Each time the log is
# read and written again, as for cutting it, all frames move one bus further.
# Number of frames, identifiers, data and times are right.
#
# Documentation: "channel: a default channel to use when the message does not
# have a channel set" for the writer; the reader says nothing of channels.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check python-can==4.6.1
venv/bin/python -W ignore - <<'EOF'
import sys

import can

ARMS = {0: b"left", 1: b"right"}


def frames():
    """Return three status frames of each arm."""
    return [
        can.Message(
            timestamp=1_700_000_000 + 0.01 * number + 0.001 * channel,
            arbitration_id=0x181,
            is_extended_id=False,
            channel=channel,
            data=data,
        )
        for number in range(3)
        for channel, data in ARMS.items()
    ]


def through(name, messages):
    """Return the messages after writing and reading a log."""
    with can.Logger(name) as log:
        for message in messages:
            log(message)
    with can.LogReader(name) as log:
        return list(log)


def channels(messages):
    """Return the channel of each arm's frames."""
    return {
        data.decode(): sorted({message.channel for message in messages if message.data == data})
        for data in ARMS.values()
    }


written = frames()
found = {kind: through(f"log.{kind}", written) for kind in ("trc", "asc", "blf")}
again = through("again.trc", found["trc"])
print(f"written: {channels(written)}")
for kind, messages in found.items():
    print(f"read from {kind}: {channels(messages)}")
print(f"read from trc, written to trc and read again: {channels(again)}")
same = all(
    [(m.arbitration_id, m.data) for m in messages] == [(m.arbitration_id, m.data) for m in written]
    for messages in found.values()
)
late = max(abs(m.timestamp - w.timestamp) for m, w in zip(found["trc"], written))
print(f"identifiers and data equal: {same}, largest difference of times in trc: {late:.1e} s")

as_described = (
    channels(written) == {"left": [0], "right": [1]}
    and channels(found["asc"]) == channels(found["blf"]) == channels(written)
    and channels(found["trc"]) == {"left": [1], "right": [2]}
    and channels(again) == {"left": [2], "right": [3]}
    and same
    and late < 1e-5
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
