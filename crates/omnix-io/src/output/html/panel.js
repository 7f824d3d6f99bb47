// What surrounds the stage: settings, times, legend, information. Builds elements and reports what was set; text only ever
// enters the page as text.
const Panel = (() => {
  const ICONS = {
    play: 'M7 4l13 8-13 8z', pause: 'M7 4h3v16H7zM14 4h3v16h-3z', loop: 'M17 2l4 4-4 4M3 11V9a3 3 0 013-3h15M7 22l-4-4 4-4M21 13v2a3 3 0 01-3 3H3',
    reset: 'M3 12a9 9 0 109-9 9 9 0 00-7 3L3 8M3 3v5h5', camera: 'M3 8h4l2-3h6l2 3h4v11H3zM12 9.5a3.5 3.5 0 100 7 3.5 3.5 0 100-7', theme: 'M12 3a9 9 0 100 18zM12 3a9 9 0 010 18', help: 'M9 9a3 3 0 115 2c-1 1-2 1.500-2 3M12 18v.01', menu: 'M4 7h16M4 12h16M4 17h16',
  };

  function element(tag, attributes = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith('on')) made.addEventListener(name.slice(2), value);
      else if (name in made && name !== 'list') made[name] = value;
      else made.setAttribute(name, value);
    }
    made.append(...children);
    return made;
  }

  function draw(button, icon) {
    const ns = 'http://www.w3.org/2000/svg';
    const svg = document.createElementNS(ns, 'svg');
    svg.setAttribute('viewBox', '0 0 24 24');
    const path = document.createElementNS(ns, 'path');
    path.setAttribute('d', ICONS[icon]);
    svg.append(path);
    button.replaceChildren(svg);
    button.classList.toggle('solid', icon === 'play' || icon === 'pause');
  }

  function iconButton(icon, title, onclick, extra = '') {
    const made = element('button', { type: 'button', className: `icon ${extra}`, title, onclick });
    made.setAttribute('aria-label', title);
    draw(made, icon);
    return made;
  }

  // A row of choices, one of which holds.
  function segments(options, value, onset) {
    const buttons = options.map(([key, text]) => element('button', { type: 'button', onclick: () => onset(key) }, text));
    const row = element('div', { className: 'segments', role: 'group' }, ...buttons);
    const set = (now) => buttons.forEach((button, i) => button.setAttribute('aria-pressed', String(options[i][0] === now)));
    set(value);
    return { row, set };
  }

  function slider(text, { min, max, step, value }, format, onset) {
    const shown = element('span', { className: 'value' }, format(value));
    const input = element('input', { type: 'range', min, max, step, value, oninput: () => set(Number(input.value)) });
    input.setAttribute('aria-label', text);
    function set(now) {
      shown.textContent = format(now);
      onset(now);
    }
    return element('label', { className: 'field' }, element('span', {}, text), shown, input);
  }

  function check(text, checked, onset, key) {
    const input = element('input', { type: 'checkbox', checked, onchange: () => onset(input.checked) });
    const row = element('label', { className: 'check' }, input, text);
    if (key) row.title = `Key ${key}`;
    return { row, set: (now) => (input.checked = now) };
  }

  const section = (title, ...children) => element('section', {}, element('h2', {}, title), ...children);
  const number = (n) => n.toLocaleString('en');

  function facts(data, cameras) {
    const { meta } = data;
    const rows = [
      ['Points', number(meta.points)], ['Let move by the gate', number(meta.moving)], ['Changing place', number(meta.changing)],
      ['Left out (not finite)', number(meta.left_out)], ['Times', number(data.times)], ['Videos', number(new Set(meta.views.map((v) => v.video)).size)], ['Cameras', number(cameras)],
      ['Confidence', meta.confidence.map((c) => c.toPrecision(3)).join(' to ')],
      ['Position step', (Math.max(...data.extent) / 65535).toPrecision(2)],
    ];
    const list = element('dl', { className: 'facts' });
    for (const [name, value] of rows) list.append(element('dt', {}, name), element('dd', {}, value));
    const notes = [
      `Unit of length: ${meta.unit}.`,
      'World axes are the network\u2019s (OpenCV: x right, y down, z forward). Each point is a pixel of one image, followed through all times; between two times of one video it is drawn on the straight line.',
      ...meta.notes,
      `Written by ${meta.program}. Drawn with three.js (MIT licence). This page opens no connection.`,
    ];
    return section('Information', list, ...notes.map((text) => element('p', { className: 'note' }, text)));
  }

  const KEYS = [
    ['Space', 'play or pause'], ['\u2190 \u2192', 'one time back or on'], ['Home End', 'first or last time'], ['1 2 3 4', 'colour by image, source, motion, confidence'],
    ['M', 'moving points only'], ['T', 'trails'], ['I', 'the image beside the points'], ['K', 'cameras'], ['C', 'view from the current camera'], ['F', 'follow the cameras in play'],
    ['R', 'reset the view'], ['L', 'light or dark background'], ['H', 'this list'],
  ];

  function help(box, close) {
    const list = element('dl');
    for (const [keys, what] of KEYS) list.append(element('dt', {}, ...keys.split(' ').flatMap((key) => [element('kbd', {}, key), ' '])), element('dd', {}, what));
    list.append(element('dt', {}, 'Click'), element('dd', {}, 'pick a point: its path and its pixel'), element('dt', {}, 'Drag'), element('dd', {}, 'orbit; one finger'), element('dt', {}, 'Right drag'), element('dd', {}, 'pan; two fingers'), element('dt', {}, 'Wheel'), element('dd', {}, 'zoom; pinch'));
    box.replaceChildren(element('h2', {}, 'Keys and mouse'), list);
    box.addEventListener('click', close);
  }

  // What the colours mean now.
  function legend(box, data, settings, trailsShown) {
    const ramp = (name, title, low, high) => element('div', { className: 'row' }, element('h2', {}, title), element('div', { className: 'ramp', style: `background:${Shaders.gradient(name)}` }), element('div', { className: 'ends' }, element('span', {}, low), element('span', {}, high)));
    const rows = [];
    if (settings.colouring === 'motion') rows.push(ramp('motion', 'Motion score \u03b8', '0', '1'));
    if (settings.colouring === 'confidence') rows.push(ramp('confidence', 'Confidence', ...[2, 98].map((p) => Data.confidence(data, data.quantiles[p]).toPrecision(3))));
    if (settings.colouring === 'image') rows.push(element('div', { className: 'row' }, element('h2', {}, 'Colour of the image')));
    if (settings.colouring === 'source') {
      const chips = data.meta.views.slice(0, 12).map((view, i) => element('span', {}, element('i', { style: `background:rgb(${Shaders.sourceColour(i).map((v) => Math.round(v * 255))})` }), `${view.video}:${view.frame}`));
      if (data.times > 12) chips.push(element('span', {}, `and ${data.times - 12} more`));
      rows.push(element('div', { className: 'row' }, element('h2', {}, 'Source image (video:frame)'), element('div', { className: 'chips' }, ...chips)));
    }
    if (trailsShown && settings.trailsByTime) rows.push(ramp('time', 'Trails: time', 'first', 'last'));
    box.replaceChildren(...rows);
  }

  return { element, draw, iconButton, segments, slider, check, section, facts, help, legend, number };
})();

