"""What makes a CANopen slave a servo drive after CiA 402."""
