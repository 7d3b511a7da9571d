"""Physics that shares no code with the controller: MuJoCo, built from the same URDF."""
