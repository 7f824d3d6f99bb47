// Reads the page's data (layout: html.rs) and what follows from it: labels, footprints, the frame of the scene.
const Data = (() => {
  const MAX_FRAMING_SAMPLES = 30000;

  // Takes the text out of its element, so that it is held once.
  function take(id) {
    const element = document.getElementById(id);
    const text = element.textContent;
    element.remove();
    return text;
  }

  function bytes(text) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const binary = atob(text);
    const out = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i++) out[i] = binary.charCodeAt(i);
    return out;
  }

  const words = (id) => new Uint16Array(bytes(take(id)).buffer);

  // Three numbers a point become four: graphics drivers want vertices of whole 4-byte words.
  function padded(triples) {
    const count = triples.length / 3;
    const out = new Uint16Array(4 * count);
    for (let i = 0, j = 0; i < triples.length; i += 3, j += 4) {
      out[j] = triples[i];
      out[j + 1] = triples[i + 1];
      out[j + 2] = triples[i + 2];
    }
    return out;
  }

  const breathe = () => new Promise((resolve) => setTimeout(resolve, 0));

  async function load(progress) {
    const meta = JSON.parse(take('omnix-meta'));
    const times = meta.views.length;
    const data = { meta, count: meta.points, changing: meta.changing, times };
    data.low = meta.box.low;
    data.extent = meta.box.high.map((high, axis) => high - meta.box.low[axis]);
    data.look = bytes(take('omnix-look'));
    data.scalars = words('omnix-scalars');
    data.pixels = words('omnix-pixels');
    data.paths = [];
    for (let time = 0; time < times; time++) {
      data.paths.push(padded(words(`omnix-path-${time}`)));
      progress(`time ${time + 1} of ${times}`);
      await breathe();
    }
    data.still = padded(words('omnix-still'));
    data.pictures = meta.views.map((_, view) => `data:image/jpeg;base64,${take(`omnix-picture-${view}`)}`);
    data.linked = meta.views.map((view, i) => i + 1 < times && meta.views[i + 1].video === view.video);
    data.runs = runs(meta.views);
    data.quantiles = confidenceQuantiles(data);
    data.frame = frame(data);
    data.footprints = footprints(data);
    return data;
  }

  // Position of a point at a time into `out`, in world axes.
  function position(data, point, time, out) {
    const still = point >= data.changing;
    const from = still ? data.still : data.paths[time];
    const at = 4 * (still ? point - data.changing : point);
    for (let axis = 0; axis < 3; axis++) out[axis] = data.low[axis] + (from[at + axis] / 65535) * data.extent[axis];
    return out;
  }

  // Stretches of times that belong to one video: motion is interpolated inside them only.
  function runs(views) {
    const out = [];
    views.forEach((view, i) => {
      const last = out[out.length - 1];
      if (last && last.video === view.video) last.last = i;
      else out.push({ video: view.video, first: i, last: i });
    });
    return out;
  }

  // The code (0..1) below which p percent of the points lie, for p of 0..100.
  function confidenceQuantiles({ count, scalars }) {
    const histogram = new Uint32Array(65536);
    for (let i = 0; i < count; i++) histogram[scalars[4 * i + 2]]++;
    const out = [];
    let code = 0;
    let below = 0;
    for (let p = 0; p <= 100; p++) {
      while (code < 65535 && below + histogram[code] <= (p / 100) * Math.max(count - 1, 0)) below += histogram[code++];
      out.push(code / 65535);
    }
    return out;
  }

  function confidence(data, code) {
    const [low, high] = data.meta.confidence;
    return low * (high / low) ** code;
  }

  // Centre and size from the middle nine tenths along each axis: a few points far away change nothing.
  function frame(data) {
    const { count, times, meta } = data;
    const lists = [[], [], []];
    const step = Math.max(1, Math.ceil((count * times) / MAX_FRAMING_SAMPLES));
    const p = [0, 0, 0];
    for (let i = 0; i < count * times; i += step) {
      position(data, i % count, Math.floor(i / count), p);
      for (let axis = 0; axis < 3; axis++) lists[axis].push(p[axis]);
    }
    const cameras = meta.views.map((view) => view.camera).filter(Boolean);
    if (count === 0) cameras.forEach(({ centre, forward }) => centre.forEach((v, axis) => lists[axis].push(v, v + forward[axis])));
    const ends = lists.map((list) => {
      if (list.length === 0) return [-1, 1];
      list.sort((a, b) => a - b);
      return [0.05, 0.95].map((part) => list[Math.round(part * (list.length - 1))]);
    });
    const radius = Math.hypot(...ends.map(([low, high]) => high - low)) / 2;
    return { centre: ends.map(([low, high]) => (low + high) / 2), radius: radius > 0 ? radius : 1 };
  }

  // Width in the world of the patch of its picture that a point stands for, at its own time.
  function footprints(data) {
    const { count, meta, scalars } = data;
    const chosen = new Float64Array(meta.views.length);
    for (let i = 0; i < count; i++) chosen[scalars[4 * i]]++;
    const spacing = meta.views.map((view, i) => Math.min(Math.sqrt((view.width * view.height) / Math.max(chosen[i], 1)), view.width / 40));
    const out = new Float32Array(count);
    const p = [0, 0, 0];
    for (let i = 0; i < count; i++) {
      const source = scalars[4 * i];
      const camera = meta.views[source].camera;
      let width = data.frame.radius / 300;
      if (camera) {
        position(data, i, source, p);
        let depth = 0;
        for (let axis = 0; axis < 3; axis++) depth += (p[axis] - camera.centre[axis]) * camera.forward[axis];
        width = Math.max(depth, 0) * camera.pixel * spacing[source];
      }
      out[i] = width;
    }
    return out;
  }

  // "video 0 · frame 12 · 0.400 s" in parts.
  function label(data, time) {
    const view = data.meta.views[time];
    const seconds = view.seconds === null ? '' : `${view.seconds.toFixed(3)} s`;
    return { video: `video ${view.video}`, frame: `frame ${view.frame}`, seconds };
  }

  return { load, position, confidence, label };
})();

