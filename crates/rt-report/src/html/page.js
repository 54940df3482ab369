"use strict";

// Cost maps: pictures of the same tasks on one scale, and what is known of the task under the pointer.
for (const map of document.querySelectorAll(".cost")) {
  const data = JSON.parse(map.querySelector("script[type='application/json']").textContent);
  const { width, height, tasks } = data;
  const taskOf = decode(data.rows, width, height);
  const colours = [];
  for (let i = 0; i < data.colours.length; i += 6) {
    colours.push([0, 2, 4].map((j) => parseInt(data.colours.slice(i + j, i + j + 2), 16)));
  }
  const canvases = [...map.querySelectorAll(".maps canvas")];
  const pictures = canvases.map((canvas) => paint(canvas, tasks[canvas.dataset.values]));
  paintScale(map.querySelector(".scale canvas"));

  const fields = [...map.querySelectorAll(".readout dd")];
  const words = {
    "task": name,
    "rays": rays,
    "estimated tests": tests,
    "estimated time": (task) => time(tasks.estimated_ns[task]),
    "measured time": (task) => time(tasks.measured_ns[task]),
    "device": (task) => data.devices[tasks.device[task]] ?? "unknown",
  };
  let shown = -1;

  canvases.forEach((canvas) => {
    const point = (event) => {
      const box = canvas.getBoundingClientRect();
      const x = Math.floor(((event.clientX - box.left) / box.width) * width);
      const y = Math.floor(((event.clientY - box.top) / box.height) * height);
      if (x >= 0 && y >= 0 && x < width && y < height) show(taskOf[y * width + x]);
    };
    canvas.addEventListener("pointermove", point);
    canvas.addEventListener("pointerdown", point);
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (step) {
        event.preventDefault();
        show(Math.min(Math.max(shown + step, 0), tasks.rays.length - 1));
      }
    });
  });

  // The first runs of each row are [task, length, …]; a row that is 0 repeats the one above it.
  function decode(rows, width, height) {
    const none = -1;
    const out = new Int32Array(width * height).fill(none);
    for (let y = 0; y < height; y++) {
      if (rows[y] === 0) {
        out.copyWithin(y * width, (y - 1) * width, y * width);
        continue;
      }
      let at = y * width;
      for (let i = 0; i < rows[y].length; i += 2) {
        out.fill(rows[y][i], at, at + rows[y][i + 1]);
        at += rows[y][i + 1];
      }
    }
    return out;
  }

  // Nanoseconds per ray on a device of mean speed to a colour.
  function colour(cost) {
    const last = colours.length - 1;
    return colours[Math.min(last, Math.floor((cost / data.top_ns) * (last + 1)))];
  }

  // What is not known is hatched.
  function hatch(x, y) {
    const grey = Math.floor((x + y) / 4) % 2 ? 140 : 186;
    return [grey, grey, grey];
  }

  function perRay(times, task) {
    const left = tasks.rays[task] - tasks.kept[task];
    if (times[task] === null || left <= 0) return null;
    return (times[task] * (data.factors[waveOf(task)][tasks.device[task]] ?? 1)) / left;
  }

  function waveOf(task) {
    return data.waves.findLastIndex((first) => first <= task);
  }

  function paint(canvas, times) {
    const picture = new ImageData(width, height);
    const costs = times.map((_, task) => perRay(times, task));
    for (let i = 0; i < taskOf.length; i++) {
      // Blank where no such ray was sent.
      if (taskOf[i] < 0) continue;
      const cost = costs[taskOf[i]];
      const paint = cost === null ? hatch(i % width, Math.floor(i / width)) : colour(cost);
      picture.data.set([...paint, 255], 4 * i);
    }
    canvas.getContext("2d").putImageData(picture, 0, 0);
    return picture;
  }

  function paintScale(canvas) {
    const context = canvas.getContext("2d");
    for (let x = 0; x < canvas.width; x++) {
      context.fillStyle = `rgb(${colour(((x + 0.5) / canvas.width) * data.top_ns).join()})`;
      context.fillRect(x, 0, 1, canvas.height);
    }
  }

  function show(task) {
    if (task === shown) return;
    shown = task;
    fields.forEach((field) => {
      field.textContent = task < 0 ? "–" : words[field.dataset.field](task);
    });
    canvases.forEach((canvas, i) => highlight(canvas, pictures[i], task));
  }

  function name(task) {
    const wave = waveOf(task);
    return data.waves.length > 1 ? `${task - data.waves[wave]} of wave ${wave}` : `${task}`;
  }

  function rays(task) {
    const kept = tasks.kept[task] ? `, ${tasks.kept[task]} kept from the estimate` : "";
    return tasks.rays[task].toLocaleString("en") + kept;
  }

  function tests(task) {
    const spread = tasks.std_error[task] === null ? "" : ` ± ${number(tasks.std_error[task])} (std. error)`;
    return number(tasks.tests[task]) + spread;
  }

  function number(value) {
    return Math.round(value).toLocaleString("en");
  }

  function time(ns) {
    if (ns === null) return "unknown";
    const [unit, factor] = ns >= 1e6 ? ["ms", 1e-6] : ns >= 1e3 ? ["µs", 1e-3] : ["ns", 1];
    return `${(ns * factor).toPrecision(3)} ${unit}`;
  }

  // The task's pixels in vermilion, which no cost has and which is seen on any paper.
  function highlight(canvas, picture, task) {
    const lit = new ImageData(new Uint8ClampedArray(picture.data), width, height);
    if (task >= 0) {
      for (let i = 0; i < taskOf.length; i++) {
        if (taskOf[i] === task) lit.data.set([213, 94, 0, 255], 4 * i);
      }
    }
    canvas.getContext("2d").putImageData(lit, 0, 0);
  }
}
