// Where one looks from: orbit, follow, limits, and views that are named.
function viewer(take, canvas, who, changed) {
  const FOV = 32, TALL = 2.35, WIDE = 1.75; // [degrees], and [m] of what a view of one player shows at least
  const CLEAR = 0.95, HEAD = 2.2; // [m] that the camera keeps from a player's axis, below this height
  const VIEWS = { start: [0.55, 0.25], front: [0, 0.05], left: [Math.PI / 2, 0.05], behind: [Math.PI, 0.05],
    above: [Math.PI, 1.45] }; // [rad] to the left of where the player faces, and above the ground
  const many = take.worlds > 1, width = many ? 2 * take.reach + 1 : WIDE, height = many ? take.reach + 1.5 : TALL;
  const camera = new THREE.PerspectiveCamera(FOV, 1, 0.05, 200);
  camera.up.set(0, 0, 1);
  const orbit = new THREE.OrbitControls(camera, canvas);
  orbit.minPolarAngle = 0.03;
  orbit.maxPolarAngle = 0.54 * Math.PI;
  orbit.minDistance = 1.2;
  orbit.addEventListener("change", changed);
  const followed = new THREE.Vector3(), place = new THREE.Vector3(), way = new THREE.Vector3();
  let follow = !many, far = 0, turned = 0;

  // [m] from which all of it fits.
  const distance = () => Math.max(height, width / camera.aspect) / 2 / Math.tan(FOV * Math.PI / 360);
  function look(name) {
    const [left, up] = VIEWS[name], heading = name === "start" ? turned : who.faces(0);
    if (many) place.set(0, 0, 0);
    else if (follow) place.copy(followed);
    else who.root(0, place);
    orbit.target.set(place.x, place.y, many ? 0.7 : 0.92);
    way.set(Math.cos(heading + left) * Math.cos(up), Math.sin(heading + left) * Math.cos(up), Math.sin(up));
    camera.position.copy(orbit.target).addScaledVector(way, distance());
    orbit.update();
    changed();
  }
  function resize(wide, tall) {
    camera.aspect = wide / Math.max(tall, 1);
    camera.updateProjectionMatrix();
    const now = distance();
    if (far) camera.position.sub(orbit.target).multiplyScalar(now / far).add(orbit.target);
    far = now;
    orbit.maxDistance = 6 * far;
  }
  // Go along with the player, who sways less than that: seconds since the last time, or none for at once.
  function go(seconds) {
    who.root(0, place);
    const share = seconds === undefined ? 1 : 1 - Math.exp(-seconds / 0.2);
    way.set((place.x - followed.x) * share, (place.y - followed.y) * share, 0);
    followed.add(way);
    if (follow && !many) {
      camera.position.add(way);
      orbit.target.add(way);
    }
  }
  // Nobody is entered, and the ground stays below.
  function keep() {
    orbit.target.z = Math.min(Math.max(orbit.target.z, 0.1), 2.5);
    orbit.update();
    camera.position.z = Math.max(camera.position.z, 0.08);
    for (let world = 0; world < take.worlds && camera.position.z < HEAD; world++) {
      who.root(world, place);
      const dx = camera.position.x - place.x, dy = camera.position.y - place.y, off = Math.hypot(dx, dy);
      if (off < CLEAR) {
        camera.position.x = place.x + (off ? dx / off : 1) * CLEAR;
        camera.position.y = place.y + (off ? dy / off : 0) * CLEAR;
      }
    }
    camera.lookAt(orbit.target);
  }
  function begin() {
    who.root(0, followed);
    turned = who.faces(0);
    look("start");
  }
  return { camera, look, resize, go, keep, begin,
    get follow() { return follow; },
    set follow(on) { follow = on && !many; who.root(0, followed); } };
}
