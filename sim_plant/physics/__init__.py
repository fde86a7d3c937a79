"""The arm, its friction and its servos, compiled; put together by `sim_plant.plant`."""
