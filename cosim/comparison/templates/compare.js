"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const style = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const font = "12px system-ui, sans-serif";
  const shown = data.runs.map(() => true);
  let plots = [];

  // Evenly spread hues, so that twelve runs stay apart.
  const colour = index => `hsl(${Math.round((360 * index) / data.runs.length + 210) % 360} 70% 45%)`;

  const column = text => {
    const bytes = Uint8Array.from(atob(text), character => character.charCodeAt(0));
    return Array.from(new Float32Array(bytes.buffer), value => (Number.isNaN(value) ? null : value));
  };

  const axis = (label, size, extra = {}) => ({
    label, labelSize: 18, size, gap: 4, font, labelFont: font, stroke: style("muted"),
    grid: { stroke: style("grid"), width: 1 }, ticks: { stroke: style("grid"), width: 1, size: 5 }, ...extra,
  });

  // Powers of ten alone: a logarithmic axis has no room for more.
  const isPower = tick => tick !== null && Number.isInteger(Number(Math.log10(tick).toFixed(6)));
  const powers = { values: (_, ticks) => ticks.map(tick => (isPower(tick) ? tick.toExponential(0) : "")) };

  const number = value => (value === null || value === undefined ? "–" : value.toPrecision(4));

  const series = (index, extra = {}) => ({
    label: data.runs[index], stroke: colour(index), width: 1.25, points: { show: false }, show: shown[index],
    value: (_, value) => number(value), ...extra,
  });

  const draw = (place, title, height, options, columns) => {
    const element = document.getElementById(place).appendChild(document.createElement("div"));
    element.className = "panel";
    element.appendChild(document.createElement("h3")).textContent = title;
    const box = element.appendChild(document.createElement("div"));
    const plot = new uPlot({ width: box.clientWidth, height, padding: [8, 16, 0, 0],
      legend: { live: place === "signals" }, ...options }, columns, box);
    plot.box = box;
    plots.push(plot);
  };

  // uPlot shares one x among all series: each run has its own point and nothing elsewhere.
  const plane = () => {
    const points = data.plane.map(([x, y], index) => ({ x, y, index })).filter(point => point.x !== null && point.y !== null);
    if (points.length < 2) return;
    points.sort((a, b) => a.x - b.x);
    const columns = [points.map(point => point.x), ...points.map(own => points.map(point => (point === own ? point.y : null)))];
    const dot = index => series(index, { points: { show: true, size: 11, fill: colour(index) }, paths: () => null });
    draw("plane", "Dynamic tyre load over weighted acceleration", 340, {
      scales: { x: { time: false, range: (_, low, high) => [low - 0.05 * (high - low), high + 0.05 * (high - low)] } },
      axes: [axis("a_w [m/s²]", 24), axis("tyre load rms [N]", 60)],
      series: [{ label: "a_w", value: (_, value) => number(value) }, ...points.map(point => dot(point.index))],
    }, columns);
  };

  const spectrum = ({ title, unit, frequency, lines }) => {
    const there = lines.map((line, index) => ({ line, index })).filter(one => one.line !== null);
    if (!there.length) return;
    draw("spectra", title, 300, {
      scales: { x: { time: false, distr: 3 }, y: { distr: 3 } },
      axes: [axis("frequency [Hz]", 24), axis(unit, 64, powers)],
      series: [{ label: "Hz", value: (_, value) => number(value) }, ...there.map(one => series(one.index))],
    }, [frequency, ...there.map(one => one.line)]);
  };

  const zoom = plot => {
    const { min, max } = plot.scales.x;
    plots.filter(other => other.overTime && other !== plot && (other.scales.x.min !== min || other.scales.x.max !== max))
      .forEach(other => other.setScale("x", { min, max }));
  };

  const signal = ({ title, unit, lines }) => {
    const there = lines.map((line, index) => ({ line, index })).filter(one => one.line !== null);
    const columns = there.map(one => column(one.line.values));
    const longest = columns.reduce((a, b) => (b.length > a.length ? b : a));
    const step = there[0].line.step;
    const time = longest.map((_, k) => k * step);
    draw("signals", title, 220, {
      scales: { x: { time: false } },
      axes: [axis("time [s]", 24), axis(unit, 60)],
      series: [{ label: "time", value: (_, value) => number(value) + " s" }, ...there.map(one => series(one.index))],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
      hooks: { setScale: [(plot, key) => { if (key === "x" && plots.includes(plot)) zoom(plot); }] },
    }, [time, ...columns.map(values => time.map((_, k) => (k < values.length ? values[k] : null)))]);
    const plot = plots[plots.length - 1];
    plot.overTime = true;
    plot.setScale("x", { min: time[0], max: Math.min(time[time.length - 1], 10) });
  };

  const redraw = () => {
    plots.forEach(plot => plot.destroy());
    plots = [];
    ["plane", "spectra", "signals"].forEach(place => document.getElementById(place).replaceChildren());
    plane();
    data.spectra.forEach(spectrum);
    data.signals.forEach(signal);
  };

  data.runs.forEach((name, index) => {
    const button = document.getElementById("names").appendChild(document.createElement("button"));
    button.type = "button";
    button.textContent = name;
    button.style.borderLeft = "6px solid " + colour(index);
    button.setAttribute("aria-pressed", "true");
    button.addEventListener("click", () => {
      shown[index] = !shown[index];
      button.setAttribute("aria-pressed", String(shown[index]));
      button.style.opacity = shown[index] ? 1 : 0.45;
      redraw();
    });
  });
  redraw();
  window.addEventListener("resize", () => plots.forEach(plot => plot.setSize({ width: plot.box.clientWidth, height: plot.height })));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
})();
