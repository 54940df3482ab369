"""Where a picture is expensive, and which way of balancing it is fastest: cost.pgm, run.html and a table.

usage: python cost_map.py [SCENE], an OBJ file or a built-in scene
"""

import sys

import numpy as np

import raybalance

height, width = 240, 320
scene = raybalance.Scene.load(sys.argv[1] if len(sys.argv) > 1 else "yard")
tracer = raybalance.Tracer(scene)
origins, directions = scene.camera(width, height)
run = tracer.run(origins, directions, counts=True, coherent=True)
print(f"{scene}: {run.hit.mean():.0%} of {len(run):,} rays hit, {run.counts.sum() / len(run):.1f} tests a ray")

# Tests of every ray, dark to bright. In a notebook: plt.imshow(cost).
cost = run.cost_map((height, width), of="counts")
grey = np.clip(255 * cost / np.quantile(cost, 0.995), 0, 255).astype(np.uint8)
with open("cost.pgm", "wb") as file:
    file.write(b"P5 %d %d 255\n" % (width, height) + grey.tobytes())

run.report.save("run.html", shape=(height, width))
for row in tracer.compare(origins, directions):
    print("{queue:8} {estimator:8} {makespan_s:.4f} s".format(**row))
