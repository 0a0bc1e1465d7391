"use strict";
(() => {
  const runs = JSON.parse(document.getElementById("signals").textContent).runs;
  const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const names = { FL: "Front left", FR: "Front right", RL: "Rear left", RR: "Rear right" };
  let plots = [];
  let shown = 0;
  let worst = { time: 0, size: -1 };

  // base64 float32, little endian, to plain numbers; a NaN becomes null, which uPlot draws as a gap.
  const column = text => {
    const bytes = Uint8Array.from(atob(text), character => character.charCodeAt(0));
    return Array.from(new Float32Array(bytes.buffer), value => (Number.isNaN(value) ? null : value));
  };

  const rms = values => {
    const known = values.filter(value => value !== null);
    return known.length ? Math.sqrt(known.reduce((sum, value) => sum + value * value, 0) / known.length) : NaN;
  };

  const figure = value => (Number.isNaN(value) ? "–" : value.toFixed(4));

  // The wheels' plots share one span of time; the overview always shows the whole run and marks that span.
  // A plot whose span is already the right one does not call its hook again, so this ends by itself.
  const zoom = (min, max) => plots.forEach(plot => {
    if (plot.whole) {
      const left = plot.valToPos(min, "x");
      plot.setSelect({ left, width: plot.valToPos(max, "x") - left, top: 0, height: plot.over.clientHeight }, false);
    } else {
      plot.setScale("x", { min, max });
    }
  });
  const zoomLike = (plot, key) => {
    if (key === "x" && plots.includes(plot)) zoom(plot.scales.x.min, plot.scales.x.max);
  };
  const zoomToSelection = plot => {
    const { left, width } = plot.select;
    if (width > 0) zoom(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
  };

  const axis = (label, size, space) => ({
    label, labelSize: 18, size, gap: 4, space, font: "12px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif", stroke: colour("muted"),
    grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1, size: 5 },
  });

  const line = (label, name, unit, digits, width = 1.25) => ({
    label, stroke: colour(name), width, points: { show: false }, spanGaps: false,
    value: (_, value) => (value === null || value === undefined ? "–" : value.toFixed(digits) + " " + unit),
  });

  // Grey behind the lines, where a fault acts.
  const shade = plot => {
    const { left, top, width, height } = plot.bbox;
    const inside = time => Math.min(Math.max(plot.valToPos(time, "x", true), left), left + width);
    plot.ctx.save();
    plot.ctx.fillStyle = colour("fault");
    runs[shown].faults.forEach(([start, end]) =>
      plot.ctx.fillRect(inside(start), top, inside(end) - inside(start), height));
    plot.ctx.restore();
  };

  const draw = (parent, height, label, time, columns, series, options = {}) => {
    const mousemove = (type) => type === "mousemove" || type === "mouseleave";
    const plot = new uPlot({
      width: parent.clientWidth, height, padding: [8, 12, 0, 0],
      scales: { x: { time: false }, y: options.range ? { range: options.range } : {} },
      axes: [axis(options.last ? "time [s]" : undefined, 24, 60), axis(label, 52, 24)],
      series: [{ label: "time", value: (_, t) => (t === null || t === undefined ? "–" : t.toFixed(2) + " s") }, ...series],
      legend: { markers: { width: 0, fill: (u, i) => u.series[i].stroke(u, i), stroke: null } },
      cursor: {
        sync: { key: "time", setSeries: false, filters: { pub: mousemove, sub: mousemove } },
        drag: { x: true, y: false, setScale: !options.whole },
      },
      hooks: { drawClear: [shade], ...(options.whole ? { setSelect: [zoomToSelection] } : { setScale: [zoomLike] }) },
    }, [time, ...columns], parent);
    plot.box = parent;
    plot.whole = Boolean(options.whole);
    plots.push(plot);
  };

  const panel = (where, title, remark) => {
    const element = where.appendChild(document.createElement("div"));
    element.className = "panel";
    const heading = element.appendChild(document.createElement("h3"));
    heading.append(title);
    heading.appendChild(document.createElement("span")).textContent = remark || "";
    return element.appendChild(document.createElement("div"));
  };

  const overview = (run, time) => {
    const where = document.getElementById("overview");
    if (run.speed) {
      draw(panel(where, "Speed, whole run"), 130, "km/h", time, [column(run.speed)],
        [line("speed", "truth", "km/h", 1)], { whole: true });
    }
    if (run.command) {
      const series = ["fl", "fr", "rl", "rr"].map(wheel => line(wheel.toUpperCase(), wheel, "", 2));
      draw(panel(where, "Damper command, 0 soft to 1 hard"), 150, "command", time, run.command.map(column), series,
        { range: [-0.02, 1.02] });
    }
  };

  // Draws one wheel and returns where its error is largest, as { time, size }.
  const wheel = (run, name, time) => {
    const truth = column(run.wheels[name].truth);
    const estimate = column(run.wheels[name].estimate);
    const error = estimate.map((value, i) => (value === null || truth[i] === null ? null : value - truth[i]));
    const box = panel(document.getElementById("wheels"), names[name],
      "error " + figure(rms(error)) + " m/s rms, truth " + figure(rms(truth)) + " m/s rms");
    draw(box, 230, "velocity [m/s]", time, [truth, estimate],
      [line("truth", "truth", "m/s", 4, 1.75), line("estimate", "estimate", "m/s", 4)]);
    draw(box, 150, "error [m/s]", time, [error], [line("estimate − truth", "error", "m/s", 4)], { last: true });
    return error.reduce((worst, value, i) =>
      (value !== null && Math.abs(value) > worst.size ? { time: time[i], size: Math.abs(value) } : worst), { time: 0, size: -1 });
  };

  const channel = (signal, time) => {
    const where = document.getElementById("channels");
    draw(panel(where, signal.name), 150, signal.unit, time, [column(signal.measured), column(signal.given)],
      [line("measured", "truth", signal.unit, 4, 1.75), line("given", "error", signal.unit, 4)], { last: true });
  };

  // Shows `seconds` around the largest error of any wheel, or the whole run for 0.
  const span = seconds => {
    const end = (runs[shown].rows - 1) * runs[shown].step;
    const length = seconds > 0 ? Math.min(seconds, end) : end;
    const start = Math.min(Math.max(worst.time - length / 2, 0), end - length);
    zoom(start, start + length);
  };

  const show = index => {
    shown = index;
    plots.forEach(plot => plot.destroy());
    plots = [];
    document.getElementById("overview").replaceChildren();
    document.getElementById("wheels").replaceChildren();
    document.getElementById("channels")?.replaceChildren();
    const run = runs[index];
    const time = Array.from({ length: run.rows }, (_, k) => k * run.step);
    overview(run, time);
    worst = Object.keys(names).map(name => wheel(run, name, time)).reduce((a, b) => (b.size > a.size ? b : a));
    run.channels.forEach(signal => channel(signal, time));
    span(10);
    document.querySelectorAll("section.run").forEach(part => { part.hidden = part.dataset.run !== String(index); });
    document.querySelectorAll(".runs button").forEach(button => {
      button.setAttribute("aria-pressed", String(button.dataset.run === String(index)));
    });
  };

  document.querySelectorAll(".runs button").forEach(button => {
    button.addEventListener("click", () => show(Number(button.dataset.run)));
  });
  document.querySelectorAll(".spans button").forEach(button => {
    button.addEventListener("click", () => span(Number(button.dataset.seconds)));
  });
  const redraw = () => {
    const free = plots.find(plot => !plot.whole);
    const { min, max } = free.scales.x;
    show(shown);
    zoom(min, max);
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("resize", redraw);
  show(0);
})();
