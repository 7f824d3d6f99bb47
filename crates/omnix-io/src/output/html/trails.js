// Where moving points have just been: a strip for each point and pair of neighbouring times of one video, drawn once for
// all and cut to the trail in the shader, so that playing changes a number only.
const Trails = (() => {
  const MOST = 4000;
  // Half the width of a trail, in CSS pixels.
  const WIDTH = 2.6;

  // The same choice at every opening: a seeded shuffle, of which the first so many are shown.
  function choose(data) {
    const moving = [];
    for (let i = 0; i < data.changing; i++) if (data.look[4 * i + 3]) moving.push(i);
    let state = 42;
    for (let i = moving.length - 1; i > 0; i--) {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      const j = Math.floor((state / 4294967296) * (i + 1));
      [moving[i], moving[j]] = [moving[j], moving[i]];
    }
    return moving.slice(0, MOST);
  }

  // Strips of these points' paths; `own` are uniforms of them alone.
  function strips(data, shared, points, own) {
    const steps = data.linked.flatMap((linked, time) => (linked ? [time] : []));
    const segments = points.length * steps.length;
    const buffers = { start: new Uint16Array(4 * segments), end: new Uint16Array(4 * segments), stamp: new Float32Array(segments), look: new Uint8Array(4 * segments), scalars: new Uint16Array(4 * segments) };
    let at = 0;
    for (const point of points) {
      for (const time of steps) {
        for (let c = 0; c < 4; c++) {
          buffers.start[4 * at + c] = data.paths[time][4 * point + c];
          buffers.end[4 * at + c] = data.paths[time + 1][4 * point + c];
          buffers.look[4 * at + c] = data.look[4 * point + c];
          buffers.scalars[4 * at + c] = data.scalars[4 * point + c];
        }
        buffers.stamp[at++] = time;
      }
    }
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0]), 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    for (const name of ['start', 'end', 'look', 'scalars']) geometry.setAttribute(name, new THREE.InstancedBufferAttribute(buffers[name], 4, true));
    geometry.setAttribute('stamp', new THREE.InstancedBufferAttribute(buffers.stamp, 1));
    geometry.instanceCount = segments;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: Shaders.trails.vertex,
      fragmentShader: Shaders.trails.fragment,
      uniforms: { ...shared, ...own },
      transparent: true,
      depthWrite: false,
      side: THREE.DoubleSide,
    });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    mesh.renderOrder = 2;
    return { mesh, geometry, material, steps: steps.length, segments };
  }

  const uniforms = (data) => ({
    now: { value: 0 },
    reach: { value: 6 },
    since: { value: 0 },
    times: { value: data.times },
    viewport: { value: [1, 1] },
    width: { value: 2 },
    byTime: { value: true },
    timeRamp: { value: Shaders.ramp('time') },
  });

  function create(data, shared) {
    const chosen = choose(data);
    const own = uniforms(data);
    const { mesh, geometry, steps, segments } = strips(data, shared, chosen, own);
    return {
      mesh,
      available: segments > 0 ? chosen.length : 0,
      // The trail does not reach back into another video; across two videos the earlier time holds.
      setTime(time) {
        const index = Math.floor(time);
        own.now.value = data.linked[index] ? time : index;
        own.since.value = data.runs.find((run) => index <= run.last).first;
      },
      setViewport(width, height, ratio) {
        own.viewport.value = [width, height];
        own.width.value = WIDTH * ratio;
      },
      set({ shown, points, reach, byTime }) {
        geometry.instanceCount = Math.min(points, chosen.length) * steps;
        mesh.visible = shown && geometry.instanceCount > 0;
        own.reach.value = reach;
        own.byTime.value = byTime;
      },
    };
  }

  // The path of one point at all times, over everything else.
  function path(data, shared) {
    const own = uniforms(data);
    [own.now.value, own.reach.value] = [data.times, 1e6];
    let made = strips(data, shared, [], own);
    made.material.depthTest = false;
    const { mesh } = made;
    mesh.visible = false;
    mesh.renderOrder = 3;
    return {
      mesh,
      setViewport(width, height, ratio) {
        own.viewport.value = [width, height];
        own.width.value = 1.4 * WIDTH * ratio;
      },
      // A point that stays in one place has no path.
      show(point) {
        mesh.visible = point >= 0 && point < data.changing;
        if (!mesh.visible) return;
        mesh.geometry.dispose();
        made = strips(data, shared, [point], own);
        mesh.geometry = made.geometry;
        mesh.visible = made.segments > 0;
      },
    };
  }

  return { create, path };
})();

