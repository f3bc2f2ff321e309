// SPDX-License-Identifier: Apache-2.0
// The curves of what each agent knows beside what other explorers would, and the small plot of surprise on each card.

const MARGIN = { left: 40, right: 10, top: 22, bottom: 30 };
const LEGEND = 20; // pixels
const WIDE = 600; // pixels: the legend is written out
const NARROW = 180; // pixels of a plot, with room for its title only
const OTHERS = {
  least_tried: ["least tried", "tried, if least tried first", "#b9c4cf", []],
  random: ["random", "tried, if at random", "#7c8a99", [2, 3]],
};

export function sharpened(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const ink = canvas.getContext("2d");
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.clearRect(0, 0, width, height);
  ink.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  return { ink, width, height };
}

// One plot for each agent, side by side.  `curves`: rows of transitions, share tried, share predictable; `baselines`: by explorer the same.
export function drawCurves(canvas, curves, baselines, colors, titles, waiting) {
  const { ink, width, height } = sharpened(canvas);
  if (!width || !height) return;
  const names = Object.keys(curves);
  if (!names.length) {
    ink.fillStyle = "#98a5b3";
    ink.fillText(waiting, 16, 30);
    return;
  }
  drawLegend(ink, width);
  const each = width / names.length;
  names.forEach((name, i) => {
    ink.save();
    ink.translate(i * each, LEGEND);
    drawPlot(ink, each, height - LEGEND, curves[name], baselines[name] || {}, colors[name], titles[name]);
    ink.restore();
  });
}

function drawLegend(ink, width) {
  const wide = width > WIDE;
  const entries = [[wide ? "share of its actions tried" : "tried", "#e9edf2", [], 2.2], ["predictable", "#e9edf2", [4, 4], 1.6]];
  for (const [short, long, color, dash] of Object.values(OTHERS)) entries.push([wide ? long : short, color, dash, 1.4]);
  let at = 10;
  ink.textAlign = "left";
  for (const [text, color, dash, thick] of entries) {
    if (at + 30 + ink.measureText(text).width > width) break;
    ink.strokeStyle = color;
    ink.setLineDash(dash);
    ink.lineWidth = thick;
    line(ink, [[at, 11], [at + 20, 11]]);
    ink.fillStyle = "#c2ccd6";
    ink.fillText(text, at + 24, 15);
    at += (wide ? 36 : 32) + ink.measureText(text).width;
  }
  ink.setLineDash([]);
}

function drawPlot(ink, width, height, curve, others, color, title) {
  const newest = curve.at(-1)[0];
  const most = nice(Math.max(8, newest));
  const ends = [curve.at(-1)[1], ...Object.values(others).map((points) => points.at(-1)[1])];
  const top = Math.min(1, nice(100 * Math.max(0.05, ...ends)) / 100);
  const x = (n) => MARGIN.left + ((width - MARGIN.left - MARGIN.right) * n) / most;
  const y = (share) => height - MARGIN.bottom - ((height - MARGIN.top - MARGIN.bottom) * share) / top;
  ink.strokeStyle = "#262f3a";
  ink.fillStyle = "#98a5b3";
  ink.lineWidth = 1;
  const steps = width > 320 ? 4 : 2;
  for (let step = 0; step <= 4; step++) {
    const share = (top * step) / 4;
    line(ink, [[MARGIN.left, y(share)], [width - MARGIN.right, y(share)]]);
    ink.textAlign = "right";
    if (height > 120 || step % 2 === 0) ink.fillText(`${+(100 * share).toFixed(1)} %`, MARGIN.left - 5, y(share) + 4);
  }
  for (let step = 0; step <= steps; step++) {
    const n = (most * step) / steps;
    ink.textAlign = step === steps ? "right" : "center";
    ink.fillText(`${Math.round(n)}`, x(n) + (step === steps ? 6 : 0), height - MARGIN.bottom + 13);
  }
  ink.textAlign = "center";
  ink.fillText("transitions", (MARGIN.left + width - MARGIN.right) / 2, height - 4);
  ink.save();
  ink.beginPath();
  ink.rect(MARGIN.left, 0, width - MARGIN.left, height);
  ink.clip();
  for (const [name, points] of Object.entries(others)) {
    const [, , shade, dash] = OTHERS[name] || ["", "", "#98a5b3", []];
    ink.strokeStyle = shade;
    ink.setLineDash(dash);
    ink.lineWidth = 1.4;
    line(ink, points.map((point) => [x(point[0]), y(Math.min(top, point[1]))]));
  }
  ink.strokeStyle = `rgb(${color})`;
  for (const [column, dash, thick] of [[1, [], 2.2], [2, [4, 4], 1.6]]) {
    ink.setLineDash(dash);
    ink.lineWidth = thick;
    const points = curve.map((point) => [x(point[0]), y(Math.min(top, point[column]))]);
    line(ink, points);
    dot(ink, points.at(-1), `rgb(${color})`);
  }
  ink.restore();
  ink.setLineDash([]);
  ink.textAlign = "left";
  ink.fillStyle = `rgb(${color})`;
  ink.fillText(title, MARGIN.left, 13);
  const gain = newest > 20 && others.random?.length ? others.random.at(-1)[1] : 0;
  if (gain > 0 && width > NARROW) {
    ink.fillStyle = "#c2ccd6";
    ink.textAlign = "right";
    ink.fillText(`${(curve.at(-1)[1] / gain).toFixed(1)} × random`, width - MARGIN.right, 13);
  }
}

export function drawSurprise(canvas, recent, hue) {
  const { ink, width, height } = sharpened(canvas);
  const most = Math.max(1, ...recent.map(([surprise]) => surprise));
  const step = width / 60;
  recent.forEach(([surprise, reached], i) => {
    ink.fillStyle = reached ? `rgba(${hue},0.75)` : "#ffca61";
    const tall = Math.max(1.5, ((height - 2) * surprise) / most);
    ink.fillRect(width - (recent.length - i) * step, height - tall, Math.max(1, step - 0.7), tall);
  });
}

function line(ink, points) {
  ink.beginPath();
  points.forEach(([a, b], i) => (i ? ink.lineTo(a, b) : ink.moveTo(a, b)));
  ink.stroke();
}

function dot(ink, [a, b], color) {
  ink.fillStyle = color;
  ink.beginPath();
  ink.arc(a, b, 3, 0, 7);
  ink.fill();
}

function nice(number) {
  const power = 10 ** Math.floor(Math.log10(number));
  return [1.2, 2, 4, 8, 12].map((one) => one * power).find((one) => one >= number);
}
