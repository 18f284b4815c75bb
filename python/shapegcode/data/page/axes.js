// Axes with their unit around the path, and how long a millimetre and a micrometre of deviation are drawn.

const LETTERS = '12px system-ui, "DejaVu Sans", sans-serif';

function ticksOf(low, high, pixels) {
  const step = roundBelow(Math.max((high - low) / Math.max(pixels / 70, 1), 1e-9)) || 1;
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 && found.length < 40; k++) found.push(k * step);
  return found;
}

/** Seen from above: along the borders. Else: along edges of the box around the path. */
function drawAxes(context, camera, low, high, colour, ground) {
  Object.assign(context, { font: LETTERS, fillStyle: colour, strokeStyle: colour, lineWidth: 1 });
  if (camera.plan) drawBorders(context, camera, colour, ground); else drawEdges(context, camera, low, high);
}

function drawBorders(context, camera, colour, ground) {
  const [wide, tall] = camera.size;
  context.fillStyle = ground;
  context.fillRect(0, 0, 42, tall);
  context.fillRect(0, tall - 38, wide, 38);
  context.fillStyle = colour;
  const middle = [wide / 2 + camera.pan[0], tall / 2 - camera.pan[1]];
  const x = (pixel) => camera.centre[0] + (pixel - middle[0]) / camera.scale;
  const y = (pixel) => camera.centre[1] - (pixel - middle[1]) / camera.scale;
  context.textAlign = "center";
  for (const value of ticksOf(x(50), x(wide - 20), wide)) {
    const at = middle[0] + (value - camera.centre[0]) * camera.scale;
    context.fillRect(at, tall - 22, 1, 5);
    context.fillText(rounded(value), at, tall - 6);
  }
  context.textAlign = "left";
  for (const value of ticksOf(y(tall - 40), y(20), tall)) {
    const at = middle[1] - (value - camera.centre[1]) * camera.scale;
    context.fillRect(0, at, 5, 1);
    context.fillText(rounded(value), 8, at + 4);
  }
  context.fillText("Y mm", 8, 14);
  context.textAlign = "right";
  context.fillText("X mm", wide - 6, tall - 24);
}

function drawEdges(context, camera, low, high) {
  const project = camera.projector();
  const middle = project(...camera.centre);
  for (let axis = 0; axis < 3; axis++) {
    const [a, b] = [0, 1, 2].filter((k) => k !== axis);
    const edges = [[0, 0], [0, 1], [1, 0], [1, 1]].map(([p, q]) => {
      const corner = [0, 0, 0];
      corner[a] = p ? high[a] : low[a];
      corner[b] = q ? high[b] : low[b];
      const at = (value) => project(...corner.map((v, k) => (k === axis ? value : v)));
      const [from, to] = [at(low[axis]), at(high[axis])];
      // Flat ones below the path, upright ones at its left.
      const score = axis < 2 ? from[1] + to[1] : -(from[0] + to[0]);
      return { at, from, to, score };
    });
    const edge = edges.reduce((best, one) => (one.score > best.score + 1e-6 ? one : best));
    const length = Math.hypot(edge.to[0] - edge.from[0], edge.to[1] - edge.from[1]);
    if (length < 30) continue;
    context.beginPath();
    context.moveTo(...edge.from);
    context.lineTo(...edge.to);
    context.stroke();
    // Letters outside of the box, names outside of numbers.
    const centre = edge.at((low[axis] + high[axis]) / 2);
    const across = [-(edge.to[1] - edge.from[1]) / length, (edge.to[0] - edge.from[0]) / length];
    const side = (centre[0] - middle[0]) * across[0] + (centre[1] - middle[1]) * across[1] < 0 ? -1 : 1;
    const outside = ([x, y], away) => [x + side * across[0] * away, y + side * across[1] * away + 4];
    context.textAlign = "center";
    for (const value of ticksOf(low[axis], high[axis], length)) {
      const point = edge.at(value);
      context.fillRect(point[0] - 1.5, point[1] - 1.5, 3, 3);
      context.fillText(rounded(value), ...outside(point, 15));
    }
    context.fillText(`${"XYZ"[axis]} mm`, ...outside(centre, 48));
  }
}

/** How long a length and a deviation are drawn. */
function drawScales(context, camera, magnify, colour, ground) {
  Object.assign(context, { font: LETTERS, textAlign: "right" });
  const right = camera.size[0] - 10;
  const bar = (unit, perUnit, y) => {
    const value = roundBelow(Math.max(110 / perUnit, 1e-9));
    const text = `${rounded(value)} ${unit}`;
    const wide = Math.max(context.measureText(text).width, value * perUnit);
    context.fillStyle = ground;
    context.fillRect(right - wide - 5, y - 17, wide + 10, 23);
    context.fillStyle = colour;
    context.fillRect(right - value * perUnit, y, value * perUnit, 2);
    context.fillText(text, right, y - 4);
  };
  bar("mm of path", camera.scale, 26);
  bar(`µm of deviation (×${magnify})`, camera.scale * magnify * 1e-3, 52);
}
