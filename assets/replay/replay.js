"use strict";
// Plays a take: what is said in JSON, the arrays it points into as one base64 block, drawn with three.js.
(() => {
  const $ = (id) => document.getElementById(id);
  const take = JSON.parse($("take").textContent);
  const bytes = Uint8Array.from(atob($("data").textContent.trim()), (c) => c.charCodeAt(0));
  const kinds = { f4: Float32Array, u4: Uint32Array, u2: Uint16Array, i2: Int16Array, i1: Int8Array, u1: Uint8Array };
  const array = ({ at, count, kind }) => new kinds[kind](bytes.buffer, at, count);
  $("title").textContent = take.title;

  const trouble = (text) => { $("trouble").textContent = text; $("trouble").hidden = false; };
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas: $("view"), antialias: true });
  } catch (error) {
    trouble("This browser shows no WebGL, which the replay needs.");
    return;
  }
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;

  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xaeb6bd);
  scene.fog = new THREE.Fog(0xaeb6bd, 18, 45);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x9c8a70, 1.6));
  const sun = new THREE.DirectionalLight(0xffffff, 2.0);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  Object.assign(sun.shadow.camera, { left: -take.reach, right: take.reach, top: take.reach, bottom: -take.reach,
    near: 1, far: 40 });
  sun.shadow.bias = -0.0006;
  sun.shadow.normalBias = 0.01;
  scene.add(sun, sun.target);

  const { frames, bodies, worlds } = take;
  const motion = array(take.motion.places), turned = array(take.motion.turns);
  const offsets = take.offsets;

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

  const moving = [];
  for (const mesh of take.meshes) {
    const still = mesh.body < 0;
    const made = new THREE.InstancedMesh(geometry(mesh), paint(mesh.colour), still ? 1 : worlds);
    made.frustumCulled = false;
    made.castShadow = !still;
    made.receiveShadow = true;
    if (still) made.setMatrixAt(0, new THREE.Matrix4());
    else moving.push([made, mesh.body]);
    scene.add(made);
  }

  const skinned = [];
  if (take.skin) {
    const inverse = take.skin.inverse.map((m) => new THREE.Matrix4().fromArray(m));
    for (const part of take.skin.parts) {
      const shape = geometry(part);
      shape.setAttribute("skinIndex", new THREE.BufferAttribute(array(part.bones), 4));
      shape.setAttribute("skinWeight", new THREE.BufferAttribute(array(part.weights), 4, true));
      for (let world = 0; world < worlds; world++) {
        const bones = inverse.map(() => new THREE.Bone());
        bones.forEach((bone) => { bone.matrixAutoUpdate = false; });
        const made = new THREE.SkinnedMesh(shape, paint(part.colour));
        made.bind(new THREE.Skeleton(bones, inverse), new THREE.Matrix4());
        made.frustumCulled = false;
        made.castShadow = made.receiveShadow = true;
        scene.add(made);
        skinned.push([bones, world]);
      }
    }
  }

  const a = new THREE.Vector3(), b = new THREE.Vector3(), p = new THREE.Quaternion(), q = new THREE.Quaternion();
  const one = new THREE.Vector3(1, 1, 1), matrices = [];
  for (let i = 0; i < worlds * bodies; i++) matrices.push(new THREE.Matrix4());
  function read(world, frame, body, place, turn) {
    const row = (world * frames + frame) * bodies + body, { low, size } = take.motion;
    place.set(low[0] + motion[3 * row] / 65535 * size[0], low[1] + motion[3 * row + 1] / 65535 * size[1],
      low[2] + motion[3 * row + 2] / 65535 * size[2]);
    turn.set(turned[4 * row], turned[4 * row + 1], turned[4 * row + 2], turned[4 * row + 3]).normalize();
  }
  function pose(time) {
    const at = Math.min(Math.max(time * take.fps, 0), frames - 1);
    const first = Math.min(Math.floor(at), Math.max(frames - 2, 0)), next = Math.min(first + 1, frames - 1);
    for (let world = 0; world < worlds; world++) {
      for (let body = 0; body < bodies; body++) {
        read(world, first, body, a, p);
        read(world, next, body, b, q);
        a.lerp(b, at - first);
        p.slerp(q, at - first);
        a.x += offsets[world][0];
        a.y += offsets[world][1];
        matrices[world * bodies + body].compose(a, p, one);
      }
    }
    for (const [mesh, body] of moving) {
      for (let world = 0; world < worlds; world++) mesh.setMatrixAt(world, matrices[world * bodies + body]);
      mesh.instanceMatrix.needsUpdate = true;
    }
    for (const [bones, world] of skinned) {
      bones.forEach((bone, i) => bone.matrixWorld.copy(matrices[world * bodies + i]));
    }
    a.setFromMatrixPosition(matrices[Math.max(take.root, 0)]);
    return a;
  }

  const camera = new THREE.PerspectiveCamera(32, 1, 0.05, 200);
  camera.up.set(0, 0, 1);
  const start = pose(0).clone();
  const middle = worlds > 1 ? new THREE.Vector3(0, 0, 0.7) : new THREE.Vector3(start.x, start.y, 0.72);
  const back = (worlds > 1 ? 2.4 : 1) * (4.2 + 0.9 * (worlds > 1 ? take.reach - 2 : 0));
  camera.position.copy(middle).add(new THREE.Vector3(0.80, -0.55, 0.25).normalize().multiplyScalar(back));
  const orbit = new THREE.OrbitControls(camera, renderer.domElement);
  orbit.target.copy(middle);
  orbit.maxPolarAngle = 0.52 * Math.PI;
  orbit.update();

  let time = 0, playing = true, last = null;
  const end = Math.max(frames - 1, 0) / take.fps, bar = $("bar");
  const followed = start.clone();
  bar.max = end || 1;
  function set(moment) {
    time = moment;
    bar.value = time;
    $("time").textContent = `${time.toFixed(2)} / ${end.toFixed(2)} s`;
  }
  function toggle() {
    playing = !playing;
    $("play").textContent = playing ? "Pause" : "Play";
  }
  $("play").onclick = toggle;
  bar.oninput = () => { if (playing) toggle(); set(Number(bar.value)); };
  addEventListener("keydown", (event) => {
    if (event.target.tagName === "SELECT") return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === " ") toggle();
    else if (event.key === "f") $("follow").checked = !$("follow").checked;
    else if (step) { if (playing) toggle(); set(Math.min(Math.max(time + step / take.fps, 0), end)); }
    else return;
    event.preventDefault();
  });

  function strips() {
    const names = Object.keys(take.contacts), canvas = $("strips"), left = 120;
    const width = canvas.clientWidth, ratio = devicePixelRatio || 1, row = 14;
    canvas.style.height = `${row * names.length}px`;
    canvas.width = width * ratio;
    canvas.height = row * names.length * ratio;
    const draw = canvas.getContext("2d");
    draw.scale(ratio, ratio);
    draw.font = "11px system-ui, sans-serif";
    draw.textBaseline = "middle";
    names.forEach((name, i) => {
      draw.fillStyle = "#22272d";
      draw.fillText(name, 0, row * (i + 0.5));
      for (const [from, to] of take.contacts[name]) {
        const scale = (width - left) / Math.max(end, 1e-9);
        draw.fillRect(left + from * scale, row * i + 3, Math.max((to - from) * scale, 1.5), row - 6);
      }
    });
    return { left, width };
  }
  let ruler = null;
  function resize() {
    renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    renderer.setSize(innerWidth, innerHeight, false);
    camera.aspect = innerWidth / innerHeight;
    camera.updateProjectionMatrix();
    ruler = strips();
  }
  addEventListener("resize", resize);
  resize();

  function draw(now) {
    if (playing && last !== null && end > 0) {
      const step = Math.min((now - last) / 1000, 0.1) * Number($("speed").value);
      set((time + step) % end);
    }
    last = now;
    const where = pose(time);
    if ($("follow").checked && worlds === 1) {
      const dx = where.x - followed.x, dy = where.y - followed.y;
      camera.position.x += dx;
      camera.position.y += dy;
      orbit.target.x += dx;
      orbit.target.y += dy;
    }
    followed.copy(where);
    sun.target.position.set(worlds > 1 ? 0 : where.x, worlds > 1 ? 0 : where.y, 0);
    sun.position.copy(sun.target.position).add(new THREE.Vector3(4, -6, 11));
    orbit.update();
    renderer.render(scene, camera);
    requestAnimationFrame(draw);
  }
  set(Math.min(take.start, end));
  requestAnimationFrame(draw);
})();
