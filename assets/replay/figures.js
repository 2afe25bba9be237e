"use strict";
// What moves: the take's meshes as three.js draws them, its ghost, and their places at a time.
function figures(take, scene) {
  const bytes = Uint8Array.from(atob(document.getElementById("data").textContent.trim()), (c) => c.charCodeAt(0));
  const kinds = { f4: Float32Array, u4: Uint32Array, u2: Uint16Array, i2: Int16Array, i1: Int8Array, u1: Uint8Array };
  const array = ({ at, count, kind }) => new kinds[kind](bytes.buffer, at, count);
  const { frames, bodies, worlds, offsets, ghost } = take;

  function geometry(mesh) {
    const made = new THREE.BufferGeometry();
    const packed = array(mesh.points), points = new Float32Array(packed.length);
    for (let i = 0; i < points.length; i++) {
      points[i] = mesh.low[i % 3] + (packed[i] / 65535) * mesh.size[i % 3];
    }
    made.setAttribute("position", new THREE.BufferAttribute(points, 3));
    made.setAttribute("normal", new THREE.BufferAttribute(array(mesh.normals), 3, true));
    made.setIndex(new THREE.BufferAttribute(array(mesh.faces), 1));
    return made;
  }
  const paint = (colour, more) => new THREE.MeshStandardMaterial({
    color: new THREE.Color().setRGB(...colour, "srgb-linear"), roughness: 0.7, ...more });
  const glass = ghost && new THREE.MeshStandardMaterial({
    color: 0x1f6fb2, roughness: 0.5, transparent: true, opacity: 0.42,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });

  const moving = [], haunting = [];
  function haunt(shape, body) {
    const place = ghost ? ghost.bodies.indexOf(body) : -1;
    if (place < 0) return;
    const made = new THREE.Mesh(shape, glass);
    made.matrixAutoUpdate = made.frustumCulled = made.visible = false;
    scene.add(made);
    haunting.push([made, place]);
  }
  for (const mesh of take.meshes) {
    const still = mesh.body < 0, shape = geometry(mesh);
    const made = new THREE.InstancedMesh(shape, paint(mesh.colour), still ? 1 : worlds);
    made.frustumCulled = false;
    made.castShadow = !still;
    made.receiveShadow = true;
    if (still) made.setMatrixAt(0, new THREE.Matrix4());
    else moving.push([made, mesh.body]);
    scene.add(made);
    haunt(shape, mesh.body);
  }

  const skinned = [], wrapped = [];
  if (take.skin) {
    const inverse = take.skin.inverse.map((m) => new THREE.Matrix4().fromArray(m));
    for (const part of take.skin.parts) {
      const shape = geometry(part);
      shape.setAttribute("skinIndex", new THREE.BufferAttribute(array(part.bones), 4));
      shape.setAttribute("skinWeight", new THREE.BufferAttribute(array(part.weights), 4, true));
      const wear = (material, bound) => {
        const bones = inverse.map(() => new THREE.Bone());
        bones.forEach((bone) => { bone.matrixAutoUpdate = false; });
        const made = new THREE.SkinnedMesh(shape, material);
        made.bind(new THREE.Skeleton(bones, bound), new THREE.Matrix4());
        made.frustumCulled = false;
        scene.add(made);
        return [made, bones];
      };
      for (let world = 0; world < worlds; world++) {
        const [made, bones] = wear(paint(part.colour), inverse);
        made.castShadow = made.receiveShadow = true;
        skinned.push([bones, world]);
      }
      // A finger of the ghost goes along with its hand: it is bound to it as if it were the hand.
      if (ghost) wrapped.push(wear(glass, inverse.map((own, i) => inverse[ghost.bodies[ghost.carriers[i]]])));
    }
  }

  // Places of `each` bodies over some rows, between two of which is interpolated.
  function track({ low, size, places, turns }, rows, each) {
    const at = array(places), turned = array(turns);
    const a = new THREE.Vector3(), b = new THREE.Vector3(), p = new THREE.Quaternion(), q = new THREE.Quaternion();
    const one = new THREE.Vector3(1, 1, 1);
    function read(row, place, turn) {
      place.set(low[0] + at[3 * row] / 65535 * size[0], low[1] + at[3 * row + 1] / 65535 * size[1],
        low[2] + at[3 * row + 2] / 65535 * size[2]);
      turn.set(turned[4 * row], turned[4 * row + 1], turned[4 * row + 2], turned[4 * row + 3]).normalize();
    }
    return (world, moment, body, dx, dy, matrix) => {
      const when = Math.min(Math.max(moment, 0), rows - 1);
      const first = Math.min(Math.floor(when), Math.max(rows - 2, 0)), next = Math.min(first + 1, rows - 1);
      read((world * rows + first) * each + body, a, p);
      read((world * rows + next) * each + body, b, q);
      a.lerp(b, when - first);
      a.x += dx;
      a.y += dy;
      return matrix.compose(a, p.slerp(q, when - first), one);
    };
  }
  const matrices = [];
  for (let i = 0; i < worlds * bodies; i++) matrices.push(new THREE.Matrix4());
  const put = track(take.motion, frames, bodies);
  const shade = ghost && track(ghost, ghost.frames, ghost.bodies.length);
  const own = new THREE.Vector3(), its = new THREE.Vector3(), matrix = new THREE.Matrix4();

  // Put everything where it is at a time [s]. haunts: "" without the ghost, "there" where it should be, "here"
  // with its root over the player's.
  function pose(time, haunts) {
    for (let world = 0; world < worlds; world++) {
      const [dx, dy] = offsets[world];
      for (let body = 0; body < bodies; body++) {
        put(world, time * take.fps, body, dx, dy, matrices[world * bodies + body]);
      }
    }
    for (const [mesh, body] of moving) {
      for (let world = 0; world < worlds; world++) mesh.setMatrixAt(world, matrices[world * bodies + body]);
      mesh.instanceMatrix.needsUpdate = true;
    }
    for (const [bones, world] of skinned) {
      bones.forEach((bone, i) => bone.matrixWorld.copy(matrices[world * bodies + i]));
    }
    if (!ghost) return;
    let dx = 0, dy = 0;
    if (haunts === "here") {
      its.setFromMatrixPosition(shade(0, time * ghost.fps, ghost.bodies.indexOf(take.root), 0, 0, matrix));
      root(0, own);
      dx = own.x - its.x;
      dy = own.y - its.y;
    }
    for (const [mesh, bones] of wrapped) {
      mesh.visible = haunts !== "";
      if (mesh.visible) {
        bones.forEach((bone, i) => shade(0, time * ghost.fps, ghost.carriers[i], dx, dy, bone.matrixWorld));
      }
    }
    for (const [mesh, place] of haunting) {
      mesh.visible = haunts !== "";
      if (!mesh.visible) continue;
      shade(0, time * ghost.fps, place, dx, dy, mesh.matrix);
      mesh.matrixWorldNeedsUpdate = true;
    }
  }
  // Where a player's root is, and which way it faces over the ground [rad].
  const root = (world, place) => place.setFromMatrixPosition(matrices[world * bodies + Math.max(take.root, 0)]);
  function faces(world) {
    const { elements } = matrices[world * bodies + Math.max(take.root, 0)];
    return Math.atan2(elements[1], elements[0]);
  }
  return { pose, root, faces };
}
