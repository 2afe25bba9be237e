// What the replay needs of three.js: `esbuild entry.js --bundle --minify --format=iife --global-name=THREE`.
export {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, HemisphereLight, InstancedMesh, Matrix4,
  Mesh, MeshStandardMaterial, PCFShadowMap, PerspectiveCamera, Quaternion, Scene, Skeleton, SkinnedMesh, Bone,
  Vector3, WebGLRenderer, Fog,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
