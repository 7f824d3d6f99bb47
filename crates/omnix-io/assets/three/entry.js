// What the viewer (src/output/html/) uses of three.js; tools/vendor_three.sh bundles it into the global THREE.
export {
    BufferAttribute,
    BufferGeometry,
    Color,
    ColorManagement,
    DoubleSide,
    GLSL3,
    InstancedBufferAttribute,
    InstancedBufferGeometry,
    LinearSRGBColorSpace,
    LineBasicMaterial,
    LineSegments,
    Mesh,
    MeshBasicMaterial,
    PerspectiveCamera,
    Points,
    RawShaderMaterial,
    Scene,
    Texture,
    Vector3,
    WebGLRenderer,
} from 'three';
export { OrbitControls } from 'three/addons/controls/OrbitControls.js';
