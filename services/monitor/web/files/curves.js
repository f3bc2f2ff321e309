// SPDX-License-Identifier: Apache-2.0
// The curve of what is known, and the small plot of surprise on each card.

const MARGIN = { left: 46, right: 14, top: 24, bottom: 30 };

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

export function drawCurves(canvas, curves, colors, waiting) {
  const { ink, width, height } = sharpened(canvas);
  if (!width || !height) return;
  const names = Object.keys(curves);
  if (!names.length) {
    ink.fillStyle = "#98a5b3";
    ink.fillText(waiting, 16, 30);
    return;
  }
  const newest = Math.max(8, ...names.map((name) => curves[name].at(-1)[0]));
  const grows = newest - Math.min(...names.map((name) => curves[name][0][0]));
  const most = grows > newest / 4 ? nice(newest) : newest + Math.max(2, Math.round(grows / 4));
  const top = Math.min(1, nice(100 * Math.max(0.05, ...names.map((name) => curves[name].at(-1)[1]))) / 100);
  const begun = Math.min(...names.map((name) => curves[name][0][0]));
  const least = begun > most / 4 ? Math.floor(begun) : 0; // agents that go on after an earlier run
  const x = (n) => MARGIN.left + ((width - MARGIN.left - MARGIN.right) * (n - least)) / (most - least);
  const y = (share) => height - MARGIN.bottom - ((height - MARGIN.top - MARGIN.bottom) * share) / top;
  ink.strokeStyle = "#262f3a";
  ink.fillStyle = "#98a5b3";
  ink.lineWidth = 1;
  for (let step = 0; step <= 4; step++) {
    const share = (top * step) / 4;
    line(ink, [[MARGIN.left, y(share)], [width - MARGIN.right, y(share)]]);
    ink.textAlign = "right";
    ink.fillText(`${+(100 * share).toFixed(1)} %`, MARGIN.left - 5, y(share) + 4);
    ink.textAlign = "center";
    const n = least + ((most - least) * step) / 4;
    ink.fillText(`${Math.round(n)}`, x(n), height - MARGIN.bottom + 13);
  }
  ink.fillText("transitions that the agent has observed", (MARGIN.left + width) / 2, height - 4);
  for (const name of names) {
    ink.strokeStyle = `rgb(${colors[name]})`;
    for (const [column, dash, thick] of [[1, [], 2.2], [2, [4, 4], 1.6]]) {
      ink.setLineDash(dash);
      ink.lineWidth = thick;
      const points = curves[name].map((point) => [x(point[0]), y(Math.min(top, point[column]))]);
      line(ink, points);
      if (points.length === 1) dot(ink, points[0], `rgb(${colors[name]})`);
    }
  }
  ink.setLineDash([]);
  ink.textAlign = "left";
  ink.fillStyle = "#e9edf2";
  let at = MARGIN.left;
  const legend = [["share of its actions tried at least once", []], ["predictable: tried twice or more, at least 80 % alike", [4, 4]]];
  for (const [text, dash] of legend) {
    ink.strokeStyle = "#e9edf2";
    ink.setLineDash(dash);
    ink.lineWidth = 2;
    line(ink, [[at, 12], [at + 22, 12]]);
    ink.fillText(text, at + 28, 16);
    at += 44 + ink.measureText(text).width;
  }
  ink.setLineDash([]);
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
