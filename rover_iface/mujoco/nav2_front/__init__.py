"""The rover in MuJoCo as a robot with Nav2 shows itself: `python -m rover_iface.mujoco.nav2_front`."""
