"""The target locator: finds the red ball in both eyes' pictures and says where it is in the root frame.

Reads: clock (for the id of the run), vision/image/{left,right}, vision/camera/{left,right}.
Writes: world/ball.
"""
