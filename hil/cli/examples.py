"""Examples of the commands, shown below the help and parsed by a test."""

from __future__ import annotations

_CAN = "--interface socketcan --channel can0"
EXAMPLES: dict[str, tuple[str, str]] = {
    "": (
        "hil plan manutec-r15 --minutes 10 -o plan.yaml && hil run plan.yaml -o runs/first",
        "hil identify runs/first && hil report runs/first",
    ),
    "try": ("hil try", "hil try --no-browser --live 8420 -o runs/demo"),
    "robot show": ("hil robot manutec-r15", "hil robot arm.yaml --json"),
    "robot new": (
        "hil robot new --urdf arm.urdf -o arm.yaml",
        "hil robot new --mdh arm.csv -o arm.yaml",
    ),
    "plan": (
        "hil plan manutec-r15 --minutes 10 -o plan.yaml",
        "hil plan arm.yaml --kind friction --axis 2 --workspace cell.yaml -o sweep.yaml",
    ),
    "dry-run": (
        "hil dry-run plan.yaml",
        "hil dry-run plan.yaml --noise-from runs/first --page plan.html",
    ),
    "view": ("hil view plan.yaml", "hil view runs/first --urdf arm.urdf -o first.html"),
    "twin": ("hil twin arm.yaml -o twin", "hil twin my-robot.yaml --output twins/my-robot"),
    "drives scan": (f"hil drives scan {_CAN}", "hil drives scan --nodes 1-6"),
    "drives check": (
        "hil drives check manutec-r15 --yes",
        f"hil drives check drives.yaml {_CAN} --axis 1 --angle 2",
    ),
    "drives jog": (
        "hil drives jog manutec-r15 3 --by -10",
        f"hil drives jog drives.yaml 'joint 3' --by 5 --speed 2 {_CAN}",
    ),
    "drives home": (
        "hil drives home manutec-r15 5 --method 37",
        f"hil drives home drives.yaml 1 {_CAN}",
    ),
    "drives monitor": (
        f"hil drives monitor drives.yaml {_CAN}",
        "hil drives monitor manutec-r15 --for 10",
    ),
    "drives new": (
        "hil drives new --eds drive.eds --nodes 1-6 -o drives.yaml",
        f"hil drives new {_CAN} -o drives.yaml",
    ),
    "drives example": ("hil drives example -o .", "hil drives example -o box"),
    "drives restore": (
        "hil drives restore runs/first/found-settings.yaml",
        f"hil drives restore runs/first/found-settings.yaml {_CAN} --other-bus",
    ),
    "drives reset-faults": (
        f"hil drives reset-faults drives.yaml {_CAN}",
        "hil drives reset-faults manutec-r15 --axis 2 --yes",
    ),
    "run": (
        "hil run plan.yaml -o runs/first --live",
        f"hil run plan.yaml -o runs/cell --drives drives.yaml {_CAN} --rehearse",
    ),
    "import": (
        "hil import --draft recording.csv --robot arm.urdf -o map.yaml",
        "hil import map.yaml -o runs/imported",
    ),
    "identify": (
        "hil identify runs/first --refine simulation",
        "hil identify runs/first --with runs/second --json",
    ),
    "validate": (
        "hil validate runs/other --model runs/first",
        "hil validate runs/first --truth manutec-r15",
    ),
    "report": ("hil report runs/first", "hil report runs/first --figures figures"),
    "friction": ("hil friction runs/sweep", "hil friction runs/sweep --model runs/first"),
    "payload two-runs": (
        "hil payload runs/first runs/loaded",
        "hil payload runs/first runs/loaded --mass 4.5",
    ),
    "payload measure": (
        "hil payload measure --model runs/first -o runs/load --at-most 5",
        f"hil payload measure --model runs/first -o runs/load --drives drives.yaml {_CAN}",
    ),
    "diagnose": ("hil diagnose runs/first", "hil diagnose runs/first --without g07"),
    "export": (
        "hil export runs/first --to c -o code",
        "hil export runs/first --to mjcf --patch arm.xml -o sim",
    ),
    "replay": (
        "hil replay runs/other --model runs/first --max-error 2deg --before arm.urdf",
        "hil replay runs/other --model runs/first --simulator mujoco --restart 0.5",
    ),
    "track": (
        "hil track fast.yaml --model runs/first -o runs/track",
        f"hil track fast.yaml --model runs/first -o runs/track --drives drives.yaml {_CAN}",
    ),
    "watch": (
        "hil watch shift.yaml --model runs/first -o runs/watch --hours 2",
        "hil watch shift.yaml --model runs/first -o runs/watch --stop --live",
    ),
    "accept": (
        "hil accept runs/good --draft -o limits.yaml",
        "hil accept runs/first --limits limits.yaml --serial 0042 -o accepted",
    ),
    "history": (
        "hil history runs/january runs/june",
        "hil history runs/january runs/june --page history.html --fail-on-change",
    ),
    "fleet identify": (
        "hil fleet identify plant-a plant-b",
        "hil fleet identify plant-a --scheduler tcp://host:8786",
    ),
    "fleet index": (
        "hil fleet index plant-a plant-b -o fleet.parquet",
        "hil fleet index s3://bucket/plant-a -o fleet.parquet --workers 4",
    ),
    "fleet query": ("hil fleet query fleet.parquet", "hil fleet query fleet.parquet --rate 0.1"),
    "fleet page": (
        "hil fleet page fleet.parquet -o fleet.html",
        "hil fleet page fleet.parquet -o fleet.html --rate 0.1",
    ),
    "doctor": ("hil doctor", "hil doctor --folder runs --json"),
}
