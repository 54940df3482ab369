"""Traces rays over several devices, finds out what they cost, and keeps all devices busy to the end.

>>> import numpy as np, raybalance
>>> vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
>>> scene = raybalance.Scene(vertices, [[0, 1, 2]])
>>> tracer = raybalance.Tracer(scene, devices="cpu:1")
>>> run = tracer.run([[0.2, 0.2, 1.0], [2.0, 2.0, 1.0]], [[0, 0, -1], [0, 0, -1]])
>>> run.t.tolist(), run.prim_id.tolist()
([1.0, inf], [0, -1])
"""

from ._raybalance import DeviceError
from ._run import Report, Run
from ._scene import Geometry, Scene
from ._tracer import Tracer

__all__ = ["DeviceError", "Geometry", "Report", "Run", "Scene", "Tracer"]
