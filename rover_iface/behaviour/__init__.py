"""What the rover does by itself: drive, follow targets, hand them off, place instruments, take images.

All of it knows the rover through `hardware.Hardware` alone, so the same code runs on a simulated rover, in a
process of its own, or on one of metal. Nothing here imports `rover_iface.simulator`.
"""
