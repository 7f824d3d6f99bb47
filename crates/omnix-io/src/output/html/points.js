// The points: those that change place, with the positions of two neighbouring times bound, and those that stay.
const Cloud = (() => {
  const codes = (array) => new THREE.BufferAttribute(array, 4, true);

  // Uniforms that points and trails share by reference.
  function uniforms(data) {
    return {
      low: { value: new THREE.Vector3(...data.low) },
      extent: { value: new THREE.Vector3(...data.extent) },
      colouring: { value: 0 },
      only: { value: -1 },
      movingOnly: { value: false },
      leastConfidence: { value: -1 },
      confidenceSpan: { value: [data.quantiles[2], data.quantiles[98]] },
      motionRamp: { value: Shaders.ramp('motion') },
      confidenceRamp: { value: Shaders.ramp('confidence') },
    };
  }

  function create(data, shared) {
    const own = { between: { value: 0 }, pixels: { value: 1 }, sizes: { value: [1, 64] } };
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: Shaders.points.vertex,
      fragmentShader: Shaders.points.fragment,
      uniforms: { ...shared, ...own },
    });
    const times = data.paths.map(codes);

    function part(first, count, position) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', position);
      geometry.setAttribute('positionNext', position);
      geometry.setAttribute('look', codes(data.look.subarray(4 * first, 4 * (first + count))));
      geometry.setAttribute('scalars', codes(data.scalars.subarray(4 * first, 4 * (first + count))));
      geometry.setAttribute('footprint', new THREE.BufferAttribute(data.footprints.subarray(first, first + count), 1));
      const points = new THREE.Points(geometry, material);
      points.frustumCulled = false;
      return points;
    }

    const objects = [];
    let moving = null;
    if (data.changing > 0) objects.push((moving = part(0, data.changing, times[0])));
    if (data.count > data.changing) objects.push(part(data.changing, data.count - data.changing, codes(data.still)));

    return {
      objects,
      // Places the points at a time between 0 and the last; across two videos the earlier time holds.
      setTime(time) {
        const index = Math.min(Math.floor(time), data.times - 1);
        const next = data.linked[index] ? index + 1 : index;
        own.between.value = next > index ? time - index : 0;
        if (!moving) return;
        moving.geometry.setAttribute('position', times[index]);
        moving.geometry.setAttribute('positionNext', times[next]);
      },
      // `pixels`: pixels of one unit of length at distance 1; `ratio`: device pixels of one CSS pixel.
      setSize(pixels, factor, ratio) {
        own.pixels.value = pixels * factor * 1.25;
        own.sizes.value = [Math.min(1.5, Math.max(1, factor)) * ratio, 64 * ratio];
      },
    };
  }

  return { create, uniforms };
})();

