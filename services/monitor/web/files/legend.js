// SPDX-License-Identifier: Apache-2.0
// The legends of the 3D view, and of the places in the picture of the body.
import { node, title } from "./cards.js";

// A sample of a mark, given its style, and what the mark means.
function entry(kind, style, text) {
  const sample = node("i", kind);
  sample.style.cssText = style;
  return node("span", "", sample, text);
}

// `hasPlaces`: whether an agent shows where its actions lead.  `hasPath`: whether the robot moves along a path of a roadmap.
// `showsFields`: whether fields are shown that nothing touches.
export function viewLegend(robot, { hasPlaces, hasPath, showsFields }) {
  const entries = [];
  if (hasPath) entries.push(entry("ramp", "background: linear-gradient(90deg, #ffd640 55%, #ffd64055 55%)", "planned path, bright: done; ring: its end"));
  if (hasPlaces) entries.push(entry("", "background: transparent; box-shadow: 0 0 0 1.5px #fff", "where an action leads"));
  if (robot?.shapes.some((one) => one.field)) entries.push(entry("", "background: #ff463c88", "field of the skin that is touched: it pushes the robot away"));
  if (showsFields) entries.push(entry("", "background: #5ac8dc88", "field that nothing touches"));
  entries.push(entry("", "background: #ff785a", "contact"));
  return entries;
}

// `places`: by part; `colorOf`: returns the colour of a part.
export function placesLegend(places, colorOf) {
  const parts = Object.entries(places);
  if (!parts.length) return [];
  const ramp = (part, text) => entry("ramp", `background: linear-gradient(90deg, rgb(26,34,44), rgb(${colorOf(part)}))`, text);
  const entries =
    parts.length > 1
      ? [...parts.map(([part, where]) => ramp(part, `${title(part)} (${where.marker})`)), node("span", "", "dark: learned, bright: much left to learn")]
      : parts.map(([part, where]) => ramp(part, `${where.marker} in the poses of the ${title(part)}: bright = much left to learn, dark = learned`));
  return [...entries, node("span", "", "white arrow: the action, dashed: its plan")];
}
