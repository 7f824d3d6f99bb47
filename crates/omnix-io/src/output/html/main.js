// Puts the parts together: settings, time, keys, and `window.omnixViewer` for tests and other pages' scripts.
const state = document.getElementById('omnix-state');
const errors = [];
const api = { ready: false, setTime() {}, time: () => 0, play() {}, pause() {}, counts: () => ({}) };
window.omnixViewer = api;

function report(extra = {}) {
  state.value = JSON.stringify({ ready: api.ready, time: api.time(), errors, ...extra });
}

function message(title, text) {
  const box = document.getElementById('message');
  box.hidden = false;
  box.firstElementChild.replaceChildren(Panel.element('strong', {}, title), Panel.element('span', {}, text));
}

function fail(error) {
  errors.push(String((error && error.message) || error));
  report();
  message('The viewer stopped', errors[errors.length - 1]);
}
window.addEventListener('error', (event) => fail(event.error || event.message));
window.addEventListener('unhandledrejection', (event) => fail(event.reason));

function start(data) {
  const byId = (id) => document.getElementById(id);
  const options = new URLSearchParams(location.hash.slice(1));
  const canvas = byId('canvas');
  const stage = Stage.create(data, canvas);
  const shared = Cloud.uniforms(data);
  const cloud = Cloud.create(data, shared);
  const trails = Trails.create(data, shared);
  const cameras = Cameras.create(data, stage.scene, stage.redraw);
  stage.scene.add(...cloud.objects, trails.mesh);
  const last = data.times - 1;
  const pick = (name, allowed, otherwise) => (allowed.includes(options.get(name)) ? options.get(name) : otherwise);
  const settings = {
    colouring: pick('colour', Shaders.COLOURINGS, 'image'), movingOnly: options.get('moving') === '1', hide: 0, only: 'all', size: 1,
    trails: options.get('trails') !== '0', trailPoints: Math.min(400, trails.available), reach: Math.max(1, Math.min(12, last, Math.max(4, Math.round(last / 2)))), trailsByTime: true,
    cameras: options.get('cameras') !== '0', pictures: pick('pictures', ['off', 'current', 'all'], 'current'), cameraSize: 1, follow: false,
    beside: options.get('beside') !== '0', speed: 6, loop: true, run: -1, theme: pick('theme', ['dark', 'light'], 'dark'),
  };
  let time = 0;
  let playing = false;
  let viewport = { ratio: 1, width: 1, height: 1, pixels: 1 };
  const current = () => Math.min(Math.round(time), last);
  const held = () => (data.linked[Math.floor(time)] ? current() : Math.floor(time));

  // Everything that follows from the settings.
  function apply() {
    shared.colouring.value = Shaders.COLOURINGS.indexOf(settings.colouring);
    shared.movingOnly.value = settings.movingOnly;
    shared.leastConfidence.value = settings.hide > 0 ? data.quantiles[settings.hide] : -1;
    shared.only.value = settings.only === 'current' ? held() : -1;
    cloud.setSize(viewport.pixels, settings.size, viewport.ratio);
    trails.set({ shown: settings.trails, points: settings.trailPoints, reach: settings.reach, byTime: settings.trailsByTime });
    for (const strips of [trails, inspect]) strips.setViewport(viewport.width, viewport.height, viewport.ratio);
    byId('picture').hidden = !settings.beside;
    cameras.set({ shown: settings.cameras, pictures: settings.pictures, scale: data.frame.radius * 0.11 * settings.cameraSize, current: held(), inside: stage.inside() });
    stage.redraw();
  }

  const bar = buildBar();
  const inspect = Inspect.create(data, shared, stage, bar.images, { stage: byId('stage'), picture: byId('picture'), picked: byId('picked') });
  stage.scene.add(inspect.mesh);
  const panel = buildPanel();
  function set(change) {
    Object.assign(settings, change);
    panel.colouring.set(settings.colouring);
    panel.movingOnly.set(settings.movingOnly);
    panel.trails.set(settings.trails);
    panel.beside.set(settings.beside);
    panel.cameras.set(settings.cameras);
    panel.follow.set(settings.follow);
    Panel.legend(byId('legend'), data, settings, settings.trails && settings.trailPoints > 0);
    apply();
  }

  function setTime(to) {
    const before = held();
    time = Math.min(Math.max(Number(to) || 0, 0), last);
    cloud.setTime(time);
    trails.setTime(time);
    inspect.setTime(time);
    if (settings.follow) stage.enter(time);
    shared.only.value = settings.only === 'current' ? held() : -1;
    if (held() !== before || !api.ready) cameras.set({ current: held(), inside: stage.inside() });
    bar.show();
    stage.redraw();
  }

  function setPlaying(on) {
    playing = on && last > 0;
    const [from, to] = range();
    if (playing && (time >= to || time < from)) setTime(from);
    Panel.draw(bar.play, playing ? 'pause' : 'play');
    bar.play.title = playing ? 'Pause (space)' : 'Play (space)';
    report({ playing });
  }

  const range = () => (settings.run < 0 ? [0, last] : [data.runs[settings.run].first, data.runs[settings.run].last]);

  function inCamera() {
    if (stage.inside()) stage.reset();
    else if (stage.enter(held())) apply();
  }

  function setTheme(theme) {
    settings.theme = theme;
    document.documentElement.dataset.theme = theme;
    const style = getComputedStyle(document.documentElement);
    stage.setGround(style.getPropertyValue('--ground').trim());
    cameras.setAccent(theme === 'dark' ? '#ffffff' : '#0b6fc2');
  }
  const flipTheme = () => setTheme(settings.theme === 'dark' ? 'light' : 'dark');
  const flipHelp = () => (byId('help').hidden = !byId('help').hidden);

  function buildBar() {
    const play = Panel.iconButton('play', 'Play (space)', () => setPlaying(!playing));
    const slider = Panel.element('input', { type: 'range', min: 0, max: Math.max(last, 0), step: 'any', value: 0, disabled: last === 0, oninput: () => setTime(slider.value) });
    slider.setAttribute('aria-label', 'Time');
    const clock = Panel.element('div', { className: 'clock' });
    const speed = Panel.element('select', { title: 'Speed, in times a second', onchange: () => (settings.speed = Number(speed.value)) });
    for (const rate of [1, 2, 3, 6, 12, 24]) speed.append(Panel.element('option', { value: rate, selected: rate === settings.speed }, `${rate}/s`));
    const loop = Panel.iconButton('loop', 'Loop', () => {
      settings.loop = !settings.loop;
      loop.setAttribute('aria-pressed', String(settings.loop));
    });
    loop.setAttribute('aria-pressed', 'true');
    const row = Panel.element('div', { className: 'transport' }, play, slider, clock, speed, loop);
    if (data.runs.length > 1 && data.runs.some((run) => run.last > run.first)) {
      const which = Panel.element('select', { title: 'Which times to play', onchange: () => ((settings.run = Number(which.value)), setTime(range()[0])) }, Panel.element('option', { value: -1 }, 'all times'));
      data.runs.forEach((run, i) => which.append(Panel.element('option', { value: i }, `video ${run.video}`)));
      row.append(which);
    }
    const strip = Panel.element('div', { className: 'strip', role: 'group' });
    strip.setAttribute('aria-label', 'Images');
    const frames = data.meta.views.map((view, i) => {
      const { video, frame, seconds } = Data.label(data, i);
      const name = [video, frame, seconds].filter(Boolean).join(', ');
      const button = Panel.element('button', { type: 'button', title: `${name} (double click: view from its camera)`, onclick: () => setTime(i), ondblclick: () => stage.enter(i) && apply() }, Panel.element('img', { src: data.pictures[i], alt: name, width: view.width, height: view.height, draggable: false }));
      if (i > 0 && !data.linked[i - 1]) button.classList.add('first');
      strip.append(button);
      return button;
    });
    byId('bar').append(row, strip);
    let marked = -1;
    function show() {
      slider.value = time;
      const { video, frame, seconds } = Data.label(data, held());
      clock.replaceChildren(`${video} \u00b7 ${frame}`, Panel.element('small', {}, `${seconds ? ` \u00b7 ${seconds}` : ''} \u00b7 ${held() + 1}/${data.times}`));
      if (marked === held()) return;
      if (marked >= 0) frames[marked].removeAttribute('aria-current');
      marked = held();
      frames[marked].setAttribute('aria-current', 'true');
      const [left, width] = [frames[marked].offsetLeft - strip.offsetLeft, frames[marked].offsetWidth];
      if (left < strip.scrollLeft || left + width > strip.scrollLeft + strip.clientWidth) strip.scrollLeft = left - strip.clientWidth / 3;
      report({ playing });
    }
    return { play, show, images: frames.map((button) => button.firstChild) };
  }

  function buildPanel() {
    const colouring = Panel.segments([['image', 'Image'], ['source', 'Source'], ['motion', 'Motion'], ['confidence', 'Conf.']], settings.colouring, (value) => set({ colouring: value }));
    const movingOnly = Panel.check('Moving points only', settings.movingOnly, (on) => set({ movingOnly: on }), 'M');
    const only = Panel.segments([['all', 'All images'], ['current', 'Current image']], settings.only, (value) => (only.set(value), set({ only: value })));
    const trailsShown = Panel.check('Trails of moving points', settings.trails, (on) => set({ trails: on }), 'T');
    const trailColour = Panel.segments([[true, 'Time'], [false, 'As points']], settings.trailsByTime, (value) => (trailColour.set(value), set({ trailsByTime: value })));
    const camerasShown = Panel.check('Camera frusta', settings.cameras, (on) => set({ cameras: on }), 'K');
    const pictures = Panel.segments([['off', 'No images'], ['current', 'Current'], ['all', 'All']], settings.pictures, (value) => (pictures.set(value), set({ pictures: value })));
    const follow = Panel.check('Follow the cameras in play', settings.follow, (on) => (set({ follow: on }), on ? setTime(time) : stage.reset()), 'F');
    const beside = Panel.check('The image beside the points', settings.beside, (on) => set({ beside: on }), 'I');
    const labelled = (text, control) => Panel.element('div', { className: 'field' }, Panel.element('span', {}, text), Panel.element('span'), control.row);
    const jump = (by) => () => (setTime(Math.min(Math.max(held() + by, 0), last)), stage.enter(held()) && apply());
    const threshold = (p) => (p === 0 ? 'show all' : `below ${p} % (${Data.confidence(data, data.quantiles[p]).toPrecision(3)})`);
    byId('panel').append(
      Panel.section('Colour', colouring.row),
      Panel.section('Points', Panel.slider('Size', { min: 0.2, max: 4, step: 0.1, value: 1 }, (v) => `\u00d7 ${v.toFixed(1)}`, (size) => set({ size })),
        Panel.slider('Hide low confidence', { min: 0, max: 99, step: 1, value: 0 }, threshold, (hide) => set({ hide })), movingOnly.row, labelled('Points of', only)),
      Panel.section('Trails', trailsShown.row, Panel.slider('Length', { min: 1, max: Math.max(last, 1), step: 1, value: settings.reach }, (v) => `${v} times`, (reach) => set({ reach })),
        Panel.slider('Points', { min: 0, max: Math.max(trails.available, 1), step: 1, value: settings.trailPoints }, (v) => `${Panel.number(Math.min(v, trails.available))} of ${Panel.number(data.meta.moving)}`, (trailPoints) => set({ trailPoints })), labelled('Colour', trailColour)),
      Panel.section('Cameras', camerasShown.row, follow.row, beside.row, Panel.slider('Size', { min: 0.1, max: 4, step: 0.1, value: 1 }, (v) => `\u00d7 ${v.toFixed(1)}`, (cameraSize) => set({ cameraSize })), labelled('Images', pictures),
        Panel.element('div', { className: 'field' }, Panel.element('span', {}, 'View from camera'), Panel.element('span'), Panel.element('div', { className: 'buttons' },
          Panel.element('button', { type: 'button', onclick: jump(-1) }, 'Previous'), Panel.element('button', { type: 'button', title: 'Key C', onclick: inCamera }, 'Current'),
          Panel.element('button', { type: 'button', onclick: jump(1) }, 'Next'), Panel.element('button', { type: 'button', className: 'all', title: 'Key R', onclick: stage.reset }, 'Reset view')))),
      Panel.facts(data, cameras.count),
    );
    return { colouring, movingOnly, trails: trailsShown, cameras: camerasShown, follow, beside };
  }

  byId('tools').append(
    Panel.iconButton('reset', 'Reset view (R)', stage.reset), Panel.iconButton('camera', 'View from the current camera (C)', inCamera),
    Panel.iconButton('theme', 'Light or dark (L)', flipTheme, 'wide'), Panel.iconButton('help', 'Keys (H)', flipHelp, 'wide'),
    Panel.iconButton('menu', 'Settings', () => byId('app').classList.toggle('open'), 'only-narrow'),
  );
  // A click that does not move picks a point; one that does turns the scene.
  let pressed = null;
  canvas.addEventListener('pointerdown', (event) => {
    byId('app').classList.remove('open');
    pressed = event.button === 0 ? [event.clientX, event.clientY] : null;
  });
  canvas.addEventListener('pointerup', (event) => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
    const box = canvas.getBoundingClientRect();
    inspect.pick([event.clientX - box.left, event.clientY - box.top]);
  });
  Panel.help(byId('help'), flipHelp);
  byId('heading').append(Panel.element('h1', {}, data.meta.title), Panel.element('p', {}, `${Panel.number(data.count)} points, ${Panel.number(data.meta.moving)} moving \u00b7 ${Panel.number(data.times)} ${data.times === 1 ? 'time' : 'times'}`));

  const keys = {
    ' ': () => setPlaying(!playing), ArrowLeft: () => setTime(Math.ceil(time) - 1), ArrowRight: () => setTime(Math.floor(time) + 1), Home: () => setTime(0), End: () => setTime(last),
    m: () => set({ movingOnly: !settings.movingOnly }), t: () => set({ trails: !settings.trails }), i: () => set({ beside: !settings.beside }), k: () => set({ cameras: !settings.cameras }), c: inCamera,
    f: () => (set({ follow: !settings.follow }), settings.follow ? setTime(time) : stage.reset()), r: stage.reset, l: flipTheme, h: flipHelp, '?': flipHelp,
    Escape: () => ((byId('help').hidden = true), inspect.clear(), byId('app').classList.remove('open')),
  };
  Shaders.COLOURINGS.forEach((colouring, i) => (keys[i + 1] = () => set({ colouring })));
  window.addEventListener('keydown', (event) => {
    const action = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === 'SELECT') return;
    event.preventDefault();
    action();
  });

  stage.on('leave', () => set({ follow: false }));
  stage.on('resize', (now) => ((viewport = now), apply()));
  setTheme(settings.theme);
  set({});
  stage.resized();
  stage.reset();
  setTime(options.get('t') || 0);
  if (options.get('view') !== null) stage.enter(Math.min(Math.max(Number(options.get('view')) || 0, 0), last)) && apply();

  let before = null;
  let rest = 0;
  let told = -1;
  function tick(now) {
    if (playing && before !== null) {
      const [from, to] = range();
      // A page that was hidden does not jump.
      const step = (Math.min(now - before, 250) / 1000) * settings.speed;
      if (time < to) {
        rest = 0;
        setTime(Math.min(time + step, to));
      } else if (!settings.loop) {
        setPlaying(false);
      } else if ((rest += step) >= 1) {
        // The last time is shown for one step, then it starts over.
        setTime(from);
      }
    }
    before = now;
    const drawn = stage.draw();
    if (drawn) inspect.follow();
    if (drawn && (playing || time !== told)) {
      told = time;
      report({ playing });
    }
    requestAnimationFrame(tick);
  }

  Object.assign(api, { setTime, time: () => time, play: () => setPlaying(true), pause: () => setPlaying(false), counts: () => ({ points: data.count, moving: data.meta.moving, changing: data.changing, times: data.times, cameras: cameras.count, trails: trails.available }), pick: (x, y) => inspect.pick([x, y]), picked: inspect.picked });
  stage.draw();
  api.ready = true;
  byId('message').hidden = true;
  if (options.get('play') === '1') setPlaying(true);
  report({ playing });
  requestAnimationFrame(tick);
}

if (!document.createElement('canvas').getContext('webgl2')) {
  message('This page needs WebGL 2', 'The browser offers none: switch on hardware acceleration in its settings, or open this file in a current version of Firefox, Chrome, Edge or Safari.');
  report({ webgl2: false });
} else {
  const progress = document.getElementById('progress');
  Data.load((text) => (progress.textContent = text)).then(start).catch(fail);
}
