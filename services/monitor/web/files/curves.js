// SPDX-License-Identifier: Apache-2.0
// The curves of what each agent knows beside what other explorers would, and the small plot of surprise on each card.

const MARGIN = { left: 40, right: 10, top: 22, bottom: 30 };
const GROUND = "#161c23"; // --panel of page.css
const LEGEND = 20; // pixels
const LEAST = 0.01; // share at the top of an axis, at least
const ROW = 12; // pixels between two numbers
const WIDE = 600; // pixels: the legend is written out
const NARROW = 180; // pixels of a plot, with room for its title only
const NICE = [1.2, 1.6, 2, 2.4, 3.2, 4, 4.8, 6, 8, 12]; // ends of an axis, times a power of ten: with whole quarters from 8 on
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
  const top = Math.min(1, nice(100 * Math.max(LEAST, ...ends)) / 100);
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
    ink.textAlign = step === steps ? "right" : step ? "center" : "left";
    ink.fillText(`${Math.round(n)}`, x(n), height - MARGIN.bottom + 13);
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
    const end = points.at(-1);
    dot(ink, end, `rgb(${color})`, dash.length > 0);
  }
  ink.restore();
  ink.setLineDash([]);
  ink.fillStyle = `rgb(${color})`;
  writeEnds(ink, x(newest), curve.at(-1).slice(1, 3), y, { right: width - MARGIN.right, top: y(top) + 10 });
  ink.textAlign = "left";
  ink.fillText(title, MARGIN.left, 13);
  const gain = newest > 20 && others.random?.length ? others.random.at(-1)[1] : 0;
  if (gain > 0 && width > NARROW) {
    ink.fillStyle = "#c2ccd6";
    ink.textAlign = "right";
    ink.fillText(`${(curve.at(-1)[1] / gain).toFixed(1)} × random`, width - MARGIN.right, 13);
  }
}

// Write the shares, tried and predictable, beside the ends of their lines at a pixel column; `y`: the row of a share.
function writeEnds(ink, column, shares, y, { right, top }) {
  const texts = shares.map((share) => `${share > 0 && share < 0.1 ? (100 * share).toFixed(1) : Math.round(100 * share)} %`);
  const isRight = column + 8 + ink.measureText(texts[0]).width < right;
  ink.textAlign = isRight ? "left" : "right";
  const lower = Math.min(y(0) - 3, Math.max(top + ROW, y(shares[1]) + 4));
  const upper = Math.min(lower - ROW, Math.max(top, y(shares[0]) + 4));
  const color = ink.fillStyle;
  [upper, lower].forEach((row, i) => {
    const wide = ink.measureText(texts[i]).width;
    ink.fillStyle = GROUND;
    ink.fillRect(column + (isRight ? 6 : -8 - wide), row - ROW + 3, wide + 2, ROW);
    ink.fillStyle = color;
    ink.fillText(texts[i], column + (isRight ? 7 : -7), row);
  });
}

export function drawSurprise(canvas, recent, hue) {
  const { ink, width, height } = sharpened(canvas);
  const most = Math.max(1, ...recent.map(([surprise]) => surprise));
  const step = width / 60;
  ink.fillStyle = "#262f3a";
  ink.fillRect(0, height - 1, width, 1);
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

function dot(ink, [a, b], color, isHollow) {
  ink.beginPath();
  ink.arc(a, b, 3, 0, 7);
  ink.fillStyle = isHollow ? GROUND : color;
  ink.fill();
  if (!isHollow) return;
  ink.setLineDash([]);
  ink.strokeStyle = color;
  ink.stroke();
}

function nice(number) {
  const power = 10 ** Math.floor(Math.log10(number));
  return NICE.map((one) => one * power).find((one) => one >= number);
}
