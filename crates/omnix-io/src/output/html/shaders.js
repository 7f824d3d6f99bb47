// Shaders of the points and the trails, and the colours that they share with the legend.
const Shaders = (() => {
  // Six stops each, from low to high; sRGB, used as they are.
  const RAMPS = {
    motion: ['#566179', '#5f5bc4', '#ac4fbd', '#ea5a7f', '#fb914c', '#fdd64f'],
    confidence: ['#46327e', '#365c8d', '#277f8e', '#1fa187', '#4ac16d', '#d8e219'],
    time: ['#4662d7', '#36aaf9', '#1ae4b6', '#a4fc3c', '#fb7e21', '#d02f05'],
  };
  // The order of these names is that of `colouring` in the shaders.
  const COLOURINGS = ['image', 'source', 'motion', 'confidence'];

  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
  const ramp = (name) => RAMPS[name].flatMap(rgb);
  const gradient = (name) => `linear-gradient(90deg, ${RAMPS[name].join(', ')})`;

  // Colour of a source image: hues a golden section apart, so that neighbours differ. The same sum as in the shaders.
  function sourceColour(source) {
    const hue = (source * 0.61803399 + 0.58) % 1;
    return [0, 4, 2].map((shift) => 0.95 - 0.62 * 0.95 * Math.min(1, Math.max(0, 2 - Math.abs(((hue * 6 + shift) % 6) - 3))));
  }

  const COMMON = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 low;
uniform vec3 extent;
uniform int colouring;
uniform int only;
uniform bool movingOnly;
uniform float leastConfidence;
uniform vec2 confidenceSpan;
uniform vec3 motionRamp[6];
uniform vec3 confidenceRamp[6];
in vec4 look;
in vec4 scalars;

bool hiddenPoint() {
  return scalars.z < leastConfidence || (movingOnly && look.a < 0.5) || (only >= 0 && int(round(scalars.x * 65535.0)) != only);
}
vec3 blend(vec3 stops[6], float x) {
  float at = clamp(x, 0.0, 1.0) * 5.0;
  int i = min(int(at), 4);
  return mix(stops[i], stops[i + 1], at - float(i));
}
vec3 sourceColour(float source) {
  float hue = fract(source * 0.61803399 + 0.58);
  vec3 k = mod(hue * 6.0 + vec3(0.0, 4.0, 2.0), 6.0);
  return vec3(0.95) - 0.62 * 0.95 * clamp(2.0 - abs(k - 3.0), 0.0, 1.0);
}
vec3 colourOf() {
  if (colouring == 1) return sourceColour(round(scalars.x * 65535.0));
  if (colouring == 2) return blend(motionRamp, scalars.y);
  if (colouring == 3) return blend(confidenceRamp, (scalars.z - confidenceSpan.x) / max(confidenceSpan.y - confidenceSpan.x, 1e-6));
  return look.rgb;
}
`;

  // A disc of the point's own footprint; between two times it is on the straight line.
  const points = {
    vertex: `${COMMON}
in vec4 position;
in vec4 positionNext;
in float footprint;
uniform float between;
uniform float pixels;
uniform vec2 sizes;
out vec3 colour;
void main() {
  gl_PointSize = 0.0;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  colour = vec3(0.0);
  if (hiddenPoint()) return;
  vec4 seen = modelViewMatrix * vec4(low + extent * mix(position.xyz, positionNext.xyz, between), 1.0);
  gl_Position = projectionMatrix * seen;
  gl_PointSize = clamp(footprint * pixels / max(-seen.z, 1e-6), sizes.x, sizes.y);
  colour = colourOf();
}`,
    fragment: `
precision highp float;
in vec3 colour;
out vec4 result;
void main() {
  vec2 from = gl_PointCoord - 0.5;
  if (dot(from, from) > 0.25) discard;
  result = vec4(colour, 1.0);
}`,
  };

  // One instance is the path of a point between two times: the part of it inside the trail, as a strip of constant width.
  const trails = {
    vertex: `${COMMON}
in vec3 position;
in vec4 start;
in vec4 end;
in float stamp;
uniform float now;
uniform float reach;
uniform float since;
uniform float times;
uniform vec2 viewport;
uniform float width;
uniform bool byTime;
uniform vec3 timeRamp[6];
out vec4 colour;
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  colour = vec4(0.0);
  float first = clamp(max(now - reach, since) - stamp, 0.0, 1.0);
  float last = clamp(now - stamp, 0.0, 1.0);
  if (last <= first || hiddenPoint()) return;
  vec4 a = modelViewMatrix * vec4(low + extent * mix(start.xyz, end.xyz, first), 1.0);
  vec4 b = modelViewMatrix * vec4(low + extent * mix(start.xyz, end.xyz, last), 1.0);
  // Nearer to the eye on the same line of sight: what a point has just moved over does not cover its trail.
  a.xyz *= 0.97;
  b.xyz *= 0.97;
  // Behind the eye there is no place on the screen: cut at a plane just before it.
  float plane = 1.01 * projectionMatrix[3][2] / (projectionMatrix[2][2] - 1.0);
  if (a.z > -plane && b.z > -plane) return;
  if (a.z > -plane) a = mix(a, b, (a.z + plane) / (a.z - b.z));
  if (b.z > -plane) b = mix(b, a, (b.z + plane) / (b.z - a.z));
  vec4 p = projectionMatrix * a;
  vec4 q = projectionMatrix * b;
  vec2 along = (q.xy / q.w - p.xy / p.w) * viewport;
  vec2 side = length(along) > 1e-4 ? normalize(vec2(-along.y, along.x)) : vec2(0.0, 1.0);
  gl_Position = position.x < 0.5 ? p : q;
  gl_Position.xy += side * position.y * width / viewport * gl_Position.w;
  float at = stamp + mix(first, last, position.x);
  vec3 hue = byTime ? blend(timeRamp, at / max(times - 1.0, 1.0)) : colourOf();
  colour = vec4(hue, pow(clamp(1.0 - (now - at) / max(reach, 1e-3), 0.0, 1.0), 0.5) * 0.95);
}`,
    fragment: `
precision highp float;
in vec4 colour;
out vec4 result;
void main() {
  result = colour;
}`,
  };

  return { COLOURINGS, points, trails, ramp, gradient, sourceColour };
})();

