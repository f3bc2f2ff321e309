// SPDX-License-Identifier: Apache-2.0
// Draws a path of a roadmap in both pictures of the robot.

const DONE = "#ffd640";
const LEFT = "rgba(255,214,64,0.55)";

// `points`: of a marker, in pixels, equal times apart; `share`: of the motion that is over; `px`: a pixel of the page.
export function drawPath(ink, points, share, px) {
  const last = points.length - 1;
  const here = Math.round(share * last);
  const line = (from, to, style, width, dash) => {
    ink.strokeStyle = style;
    ink.lineWidth = width * px;
    ink.setLineDash(dash.map((one) => one * px));
    ink.beginPath();
    for (let i = from; i <= to; i++) (i === from ? ink.moveTo : ink.lineTo).call(ink, points[i][0], points[i][1]);
    ink.stroke();
    ink.setLineDash([]);
  };
  line(here, last, LEFT, 2, [6, 5]);
  line(0, here, DONE, 3, []);
  for (const [radius, style] of [[8, "rgba(8,11,15,0.8)"], [7, DONE]]) {
    ink.strokeStyle = style;
    ink.lineWidth = 2.4 * px;
    ink.beginPath();
    ink.arc(points[last][0], points[last][1], radius * px, 0, 7);
    ink.stroke();
  }
}
