"""What the robot's own firmware does, as a passive state machine above a body."""
