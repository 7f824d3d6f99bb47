// The picture beside the points, and a point that was picked: its whole path in the scene, its pixel in the picture that it comes
// from, and where it is at every time.
const Inspect = (() => {
  // A click this near to a point means it, in CSS pixels.
  const NEAR = 8;

  function hidden(data, shared, point) {
    const [source, confidence] = [data.scalars[4 * point], data.scalars[4 * point + 2] / 65535];
    return confidence < shared.leastConfidence.value || (shared.movingOnly.value && data.look[4 * point + 3] < 128) || (shared.only.value >= 0 && source !== shared.only.value);
  }

  // Where a point is at a time between two, as the points are drawn.
  function between(data, point, time, out) {
    const index = Math.min(Math.floor(time), data.times - 1);
    Data.position(data, point, index, out);
    if (!data.linked[index] || time === index) return out;
    const next = Data.position(data, point, index + 1, [0, 0, 0]);
    for (let axis = 0; axis < 3; axis++) out[axis] += (next[axis] - out[axis]) * (time - index);
    return out;
  }

  // The point under a place of the stage: of those near enough the one nearest to the eye.
  function pick(data, shared, stage, time, [x, y]) {
    let [found, nearest] = [-1, Infinity];
    const at = [0, 0, 0];
    for (let point = 0; point < data.count; point++) {
      if (hidden(data, shared, point)) continue;
      const seen = stage.place(between(data, point, time, at));
      if (!seen || seen.depth >= nearest || Math.hypot(seen.x - x, seen.y - y) > NEAR) continue;
      [found, nearest] = [point, seen.depth];
    }
    return found;
  }

  // A picture with a cross on one of its pixels, from an image of the strip below the stage.
  function paint(canvas, image, view, pixel) {
    const show = () => {
      const context = canvas.getContext('2d');
      [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
      context.drawImage(image, 0, 0);
      if (!pixel) return;
      const [x, y] = [((pixel[0] + 0.5) * canvas.width) / view.width, ((pixel[1] + 0.5) * canvas.height) / view.height];
      for (const [colour, width] of [['#000', 4], ['#fff', 1.5]]) {
        context.strokeStyle = colour;
        context.lineWidth = width;
        context.beginPath();
        context.arc(x, y, 6, 0, 2 * Math.PI);
        context.stroke();
      }
    };
    if (image.complete && image.naturalWidth > 0) show();
    else image.addEventListener('load', show, { once: true });
  }

  function create(data, shared, stage, images, boxes) {
    const path = Trails.path(data, shared);
    const ring = Panel.element('div', { className: 'ring', hidden: true });
    const beside = Panel.element('canvas');
    const caption = Panel.element('span');
    boxes.picture.append(beside, caption);
    boxes.stage.append(ring);
    let [point, time, shownAt, shownOf] = [-1, 0, -1, -1];
    let rows = [];

    const pixel = (of) => [data.pixels[2 * of], data.pixels[2 * of + 1]];
    const coordinates = (of, at) => Data.position(data, of, at, [0, 0, 0]);
    const written = (numbers) => numbers.map((v) => v.toFixed(3)).join(' ');

    // The picked point's card, anew when another is picked.
    function describe() {
      boxes.picked.hidden = point < 0;
      if (point < 0) return boxes.picked.replaceChildren();
      const source = data.scalars[4 * point];
      const view = data.meta.views[source];
      const own = coordinates(point, source);
      const { video, frame } = Data.label(data, source);
      const facts = [
        ['Pixel', pixel(point).join(', ')], ['Of', `${video}, ${frame}`], ['Let move by the gate', data.look[4 * point + 3] ? 'yes' : 'no'],
        ['Motion score \u03b8', (data.scalars[4 * point + 1] / 65535).toFixed(3)], ['Confidence', Data.confidence(data, data.scalars[4 * point + 2] / 65535).toPrecision(3)],
      ];
      const list = Panel.element('dl', { className: 'facts' });
      for (const [name, value] of facts) list.append(Panel.element('dt', {}, name), Panel.element('dd', {}, value));
      const table = Panel.element('tbody');
      rows = data.meta.views.map((_, at) => {
        const now = coordinates(point, at);
        const away = Math.hypot(...now.map((v, axis) => v - own[axis]));
        const row = Panel.element('tr', {}, Panel.element('td', {}, String(at)), ...now.map((v) => Panel.element('td', {}, v.toFixed(3))), Panel.element('td', {}, away.toFixed(3)));
        table.append(row);
        return row;
      });
      const head = Panel.element('tr', {}, ...['time', 'x', 'y', 'z', 'moved'].map((text) => Panel.element('th', {}, text)));
      const picture = Panel.element('canvas');
      paint(picture, images[source], view, pixel(point));
      const close = Panel.element('button', { type: 'button', title: 'Escape', onclick: () => choose(-1) }, 'Close');
      boxes.picked.replaceChildren(Panel.element('h2', {}, `Point ${Panel.number(point)}`), picture, list, Panel.element('div', { className: 'table' }, Panel.element('table', {}, Panel.element('thead', {}, head), table)), close);
    }

    function choose(which) {
      point = which;
      path.show(point);
      describe();
      shownOf = -1;
      setTime(time);
      stage.redraw();
    }

    function setTime(to) {
      time = to;
      const held = Math.min(data.linked[Math.floor(time)] ? Math.round(time) : Math.floor(time), data.times - 1);
      if (shownAt === held && shownOf === point) return;
      rows[shownAt]?.removeAttribute('aria-current');
      rows[held]?.setAttribute('aria-current', 'true');
      rows[held]?.scrollIntoView({ block: 'nearest' });
      [shownAt, shownOf] = [held, point];
      const { video, frame, seconds } = Data.label(data, held);
      caption.textContent = [video, frame, seconds].filter(Boolean).join(' \u00b7 ');
      const mark = point >= 0 && data.scalars[4 * point] === held ? pixel(point) : null;
      paint(beside, images[held], data.meta.views[held], mark);
    }

    return {
      mesh: path.mesh,
      setTime,
      setViewport: path.setViewport,
      clear: () => choose(-1),
      pick: (at) => (choose(pick(data, shared, stage, time, at)), point),
      picked: () => (point < 0 ? null : { point, pixel: pixel(point), source: data.scalars[4 * point], path: data.meta.views.map((_, at) => written(coordinates(point, at))) }),
      // Puts the ring around the picked point; called after a picture was drawn.
      follow() {
        const seen = point >= 0 && !hidden(data, shared, point) && stage.place(between(data, point, time, [0, 0, 0]));
        ring.hidden = !seen;
        if (seen) ring.style.transform = `translate(${seen.x}px, ${seen.y}px)`;
      },
    };
  }

  return { create };
})();

