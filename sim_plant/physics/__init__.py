"""Compiled physics of arm, friction and servos, used by `sim_plant.plant`."""
