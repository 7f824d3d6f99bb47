// The scene, the eye and the drawing of it: a picture is drawn only when something changed.
const Stage = (() => {
  const FIELD = 50;

  function create(data, canvas) {
    const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: 'high-performance' });
    // Colours go to the screen as they were read.
    THREE.ColorManagement.enabled = false;
    renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    const scene = new THREE.Scene();
    const eye = new THREE.PerspectiveCamera(FIELD, 1, 0.01, 100);
    const { centre, radius } = data.frame;
    const views = data.meta.views.filter((view) => view.camera).map((view) => view.camera);
    const mean = (name) => views.reduce((sum, view) => sum.add(new THREE.Vector3(...view[name])), new THREE.Vector3());
    const up = views.length > 0 ? mean('up').normalize() : new THREE.Vector3(0, -1, 0);
    if (up.lengthSq() < 0.5) up.set(0, -1, 0);
    eye.up.copy(up);
    const controls = new THREE.OrbitControls(eye, canvas);
    controls.enableDamping = true;
    controls.dampingFactor = 0.12;
    controls.zoomToCursor = true;

    let dirty = true;
    let inside = false;
    // While the eye is in a camera the controls leave its orientation alone, roll included; a touch takes over.
    controls.addEventListener('change', () => (dirty = true));
    const listeners = { leave: () => {}, resize: () => {} };
    function leave() {
      if (!inside) return;
      inside = false;
      listeners.leave();
    }
    controls.addEventListener('start', leave);

    function depthRange() {
      const away = eye.position.distanceTo(new THREE.Vector3(...centre));
      eye.near = Math.max(radius * 1e-3, (away - radius * 40) * 0.5, 1e-6);
      eye.far = away + radius * 400;
    }

    // The scene as its cameras see it, from a little behind and above them.
    function reset() {
      leave();
      const target = new THREE.Vector3(...centre);
      // A little towards the cameras, so that they are in sight too, unless they are far outside.
      if (views.length > 0) {
        const towards = mean('centre').divideScalar(views.length).sub(target);
        if (towards.length() < radius * 3) target.addScaledVector(towards, 0.2);
      }
      const forward = views.length > 0 ? mean('forward').normalize() : new THREE.Vector3(0, 0, 1);
      if (forward.lengthSq() < 0.5) forward.set(0, 0, 1);
      const aspect = Math.min(eye.aspect, 1.4);
      const away = (radius * 1.1) / Math.tan((FIELD * Math.PI) / 360) / Math.max(Math.min(aspect, 1), 0.55);
      const right = new THREE.Vector3().crossVectors(forward, up);
      const direction = forward.clone().multiplyScalar(-1).addScaledVector(up, 0.42).addScaledVector(right, 0.34).normalize();
      eye.fov = FIELD;
      eye.position.copy(target).addScaledVector(direction, away);
      controls.target.copy(target);
      controls.update();
      resized();
    }

    // Into the camera of a time between two views of one video: its place, axes and field of view.
    function enter(time) {
      const index = Math.min(Math.floor(time), data.times - 1);
      const from = data.meta.views[index].camera;
      if (!from) return false;
      const next = data.linked[index] ? data.meta.views[index + 1].camera : null;
      const part = next ? time - index : 0;
      const between = (name) => new THREE.Vector3(...from[name]).lerp(new THREE.Vector3(...(next || from)[name]), part);
      eye.position.copy(between('centre'));
      const forward = between('forward').normalize();
      const ahead = Math.max(new THREE.Vector3(...centre).sub(eye.position).dot(forward), radius * 0.3);
      controls.target.copy(eye.position).addScaledVector(forward, ahead);
      eye.up.copy(between('up'));
      eye.lookAt(controls.target);
      eye.up.copy(up);
      // The whole picture fits: whichever side is short decides.
      const [horizontal, vertical] = from.fov.map((degrees) => Math.tan((degrees * Math.PI) / 360));
      eye.fov = (Math.atan(Math.max(vertical, horizontal / eye.aspect)) * 360) / Math.PI;
      inside = true;
      resized();
      return true;
    }

    function resized() {
      const box = canvas.parentElement.getBoundingClientRect();
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      const [width, height] = [Math.max(box.width, 1), Math.max(box.height, 1)];
      const size = renderer.getSize(new THREE.Vector3());
      if (size.x !== width || size.y !== height || renderer.getPixelRatio() !== ratio) {
        renderer.setPixelRatio(ratio);
        renderer.setSize(width, height, false);
      }
      eye.aspect = width / height;
      eye.updateProjectionMatrix();
      listeners.resize({ width: width * ratio, height: height * ratio, ratio, pixels: (height * ratio) / (2 * Math.tan((eye.fov * Math.PI) / 360)) });
      dirty = true;
    }
    new ResizeObserver(resized).observe(canvas.parentElement);

    return {
      scene,
      reset,
      enter,
      leave,
      resized,
      // Where a place of the world is on the stage, in CSS pixels, and its depth; null behind the eye.
      place([x, y, z]) {
        const [v, p] = [eye.matrixWorldInverse.elements, eye.projectionMatrix.elements];
        const depth = -(v[2] * x + v[6] * y + v[10] * z + v[14]);
        if (depth <= eye.near) return null;
        const [across, up] = [v[0] * x + v[4] * y + v[8] * z + v[12], v[1] * x + v[5] * y + v[9] * z + v[13]];
        const size = canvas.getBoundingClientRect();
        return { x: (0.5 + (0.5 * p[0] * across) / depth) * size.width, y: (0.5 - (0.5 * p[5] * up) / depth) * size.height, depth };
      },
      redraw: () => (dirty = true),
      inside: () => inside,
      on: (name, listener) => (listeners[name] = listener),
      setGround: (hex) => {
        renderer.setClearColor(new THREE.Color(hex), 1);
        dirty = true;
      },
      // Draws if anything changed; says whether it did.
      draw() {
        if (!inside) controls.update();
        if (!dirty) return false;
        dirty = false;
        depthRange();
        eye.updateProjectionMatrix();
        renderer.render(scene, eye);
        return true;
      },
    };
  }

  return { create };
})();

