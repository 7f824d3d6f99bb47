// The cameras: an outline of each view's frustum with its picture, the current time's stressed.
const Cameras = (() => {
  // Centre to the four corners, around the picture, and a mark on its upper edge.
  function outline(camera) {
    const [a, b, c, d] = camera.corners;
    const middle = (p, q, part) => p.map((v, i) => v + (q[i] - v) * part);
    const raise = (p) => p.map((v, i) => v + (a[i] - d[i]) * 0.14);
    const top = raise(middle(a, b, 0.5));
    const zero = [0, 0, 0];
    const lines = [zero, a, zero, b, zero, c, zero, d, a, b, b, c, c, d, d, a, middle(a, b, 0.38), top, top, middle(a, b, 0.62)];
    return new Float32Array(lines.flat());
  }

  function create(data, scene, redraw) {
    const items = data.meta.views.map((view, index) => {
      if (!view.camera) return null;
      const lines = new THREE.BufferGeometry();
      lines.setAttribute('position', new THREE.BufferAttribute(outline(view.camera), 3));
      const colour = new THREE.Color(...Shaders.sourceColour(index));
      const frustum = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: colour, transparent: true }));
      const plane = new THREE.BufferGeometry();
      plane.setAttribute('position', new THREE.BufferAttribute(new Float32Array(view.camera.corners.flat()), 3));
      plane.setAttribute('uv', new THREE.BufferAttribute(new Float32Array([0, 1, 1, 1, 1, 0, 0, 0]), 2));
      plane.setIndex([0, 1, 2, 0, 2, 3]);
      const picture = new THREE.Mesh(plane, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, transparent: true, visible: false }));
      for (const object of [frustum, picture]) {
        object.position.set(...view.camera.centre);
        scene.add(object);
      }
      return { index, frustum, picture, colour, asked: false };
    });
    // Many outlines on top of each other would hide what lies behind them.
    const faint = 0.55 * Math.max(0.35, Math.min(1, Math.sqrt(12 / data.times)));
    const accent = new THREE.Color();
    let state = { shown: true, pictures: 'current', scale: 1, current: 0, inside: false };

    // Textures are made when first seen.
    function texture(item) {
      if (item.asked) return;
      item.asked = true;
      const image = new Image();
      image.onload = () => {
        const map = new THREE.Texture(image);
        map.needsUpdate = true;
        item.picture.material.map = map;
        item.picture.material.visible = true;
        item.picture.material.needsUpdate = true;
        redraw();
      };
      image.src = data.pictures[item.index];
    }

    function apply() {
      for (const item of items) {
        if (!item) continue;
        const current = item.index === state.current;
        // From inside a camera its own outline and those of its neighbours would cover what it sees.
        const shown = state.shown && !state.inside;
        item.frustum.visible = shown;
        item.frustum.material.color.copy(current ? accent : item.colour);
        item.frustum.material.opacity = current ? 1 : faint;
        item.frustum.renderOrder = current ? 1 : 0;
        item.picture.visible = shown && (state.pictures === 'all' || (state.pictures === 'current' && current));
        item.picture.material.opacity = current ? 1 : 0.8;
        if (item.picture.visible) texture(item);
        for (const object of [item.frustum, item.picture]) object.scale.setScalar(state.scale * (current ? 1.25 : 1));
      }
      redraw();
    }

    return {
      count: items.filter(Boolean).length,
      set(change) {
        state = { ...state, ...change };
        apply();
      },
      setAccent(hex) {
        accent.set(hex);
        apply();
      },
    };
  }

  return { create };
})();

