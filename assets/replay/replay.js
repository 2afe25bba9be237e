// Plays a take: its JSON, figures and a camera, the panel, keys, and addresses that name a moment.
(() => {
  const $ = (id) => document.getElementById(id);
  const take = JSON.parse($("take").textContent);
  $("title").textContent = take.title;
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas: $("view"), antialias: true,
      preserveDrawingBuffer: true }); // a paused page is not drawn anew, and has to stay when it is printed
  } catch (error) {
    $("trouble").textContent = "This browser shows no WebGL, which the replay needs.";
    $("trouble").hidden = false;
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

  const end = Math.max(take.frames - 1, 0) / take.fps, GHOSTS = take.ghost ? ["", "there", "here"] : [""];
  const who = figures(take, scene), spot = new THREE.Vector3();
  let time = 0, playing = true, stale = true, jumped = false, last = null, ghost = "";
  const touch = () => { stale = true; };
  const view = viewer(take, $("view"), who, touch);

  // ---------------------------------------------------------------------------------------- what can be done
  const pad = (text, longest) => text.padStart(longest.length, "\u2007"); // a space as wide as a figure
  function seek(moment) {
    time = Math.min(Math.max(moment, 0), end);
    $("bar").value = time;
    $("seconds").textContent = pad(time.toFixed(2), end.toFixed(2));
    $("frame").textContent = pad(String(Math.round(time * take.fps)), String(take.frames - 1));
    jumped = true;
    touch();
  }
  function play(on) {
    playing = on;
    $("play").textContent = on ? "Pause" : "Play";
    touch();
  }
  function halt(moment) { play(false); seek(moment); mark(); }
  const step = (count) => halt((Math.round(time * take.fps) + count) / take.fps);
  function haunt(how) {
    ghost = how;
    $("ghost").setAttribute("aria-pressed", how !== "");
    $("ghost").textContent = { "": "Ghost", there: "Ghost: its place", here: "Ghost: over player" }[how];
    touch();
  }
  function nextGhost() { haunt(GHOSTS[(GHOSTS.indexOf(ghost) + 1) % GHOSTS.length]); mark(); }
  function follow(on) {
    view.follow = on;
    $("follow").setAttribute("aria-pressed", view.follow);
  }
  function reset() { follow(true); view.begin(); }
  function faster(by) {
    const speed = $("speed"), to = speed.selectedIndex + by;
    if (speed.options[to]) speed.selectedIndex = to;
  }
  function ask() {
    $("help").hidden = !$("help").hidden;
    $("ask").setAttribute("aria-pressed", !$("help").hidden);
  }

  // ------------------------------------------------------------------------------ addresses: #t=3.2&ghost=here
  function mark() {
    const said = [...(playing ? [] : [`t=${+time.toFixed(3)}`]), ...(ghost ? [`ghost=${ghost}`] : [])];
    try { history.replaceState(null, "", `#${said.join("&")}`); } catch (error) { /* a page in a frame may not */ }
  }
  function heed() {
    const said = new URLSearchParams(location.hash.slice(1));
    const moment = Number(said.get("t") ?? NaN);
    if (Number.isFinite(moment)) {
      play(false);
      seek(moment);
    }
    if (said.has("ghost") && take.ghost) haunt(said.get("ghost") === "here" ? "here" : "there");
    if (said.has("speed")) $("speed").value = said.get("speed");
    if (!$("speed").value) $("speed").value = "1";
    if (said.has("follow")) follow(said.get("follow") !== "0");
    who.pose(time, ghost);
    view.go();
    if (["front", "left", "behind", "above"].includes(said.get("view"))) view.look(said.get("view"));
    if (said.has("help") === $("help").hidden) ask();
  }
  addEventListener("hashchange", heed);

  // ------------------------------------------------------------------------------------------ panel and keys
  const press = { play: () => { play(!playing); mark(); }, back: () => step(-1), on: () => step(1),
    follow: () => follow(!view.follow), ghost: nextGhost, reset, ask };
  for (const [id, act] of Object.entries(press)) {
    $(id).onclick = (event) => { act(); if (event.detail) $(id).blur(); };
  }
  $("speed").onchange = () => $("speed").blur();
  $("bar").max = end || 1;
  $("bar").oninput = () => halt(Number($("bar").value));
  const keys = { " ": press.play, f: press.follow, g: nextGhost, r: reset, "?": ask,
    Home: () => halt(0), End: () => halt(end),
    "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1),
    1: () => view.look("front"), 2: () => view.look("left"), 3: () => view.look("behind"), 4: () => view.look("above"),
    Escape: () => { if (!$("help").hidden) ask(); } };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    if (event.target.tagName === "BUTTON" && [" ", "Enter"].includes(event.key)) return;
    const frames = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (frames) step(event.shiftKey ? 10 * frames : frames);
    else if (keys[event.key]) keys[event.key]();
    else return;
    event.preventDefault();
  });
  for (const node of document.querySelectorAll(".ghost")) node.hidden = !take.ghost;
  $("follow").hidden = take.worlds > 1;
  $("time").title = `of ${end.toFixed(2)} s, ${take.frames - 1} frames at ${+take.fps.toFixed(2)} a second`;

  const names = Object.keys(take.contacts), ROW = 14, THUMB = 8;
  for (const name of names) $("names").append(Object.assign(document.createElement("div"), { textContent: name }));
  function strips() {
    const canvas = $("strips"), ratio = devicePixelRatio || 1;
    canvas.style.height = `${ROW * names.length}px`;
    const width = canvas.clientWidth;
    canvas.width = width * ratio;
    canvas.height = ROW * names.length * ratio;
    const draw = canvas.getContext("2d"), scale = (width - 2 * THUMB) / Math.max(end, 1e-9);
    draw.scale(ratio, ratio);
    names.forEach((name, i) => {
      draw.fillStyle = "#e3e6e9";
      draw.fillRect(THUMB, ROW * i + 3, width - 2 * THUMB, ROW - 6);
      draw.fillStyle = "#4a5560";
      for (const [from, to] of take.contacts[name]) {
        draw.fillRect(THUMB + from * scale, ROW * i + 3, Math.max((Math.min(to, end) - from) * scale, 1.5), ROW - 6);
      }
    });
  }
  $("strips").onpointerdown = $("strips").onpointermove = (event) => {
    if (!event.buttons) return;
    event.target.setPointerCapture(event.pointerId);
    halt((event.offsetX - THUMB) / Math.max(event.target.clientWidth - 2 * THUMB, 1) * end);
  };

  // ----------------------------------------------------------------------------------------------- drawing
  function resize() {
    const { clientWidth, clientHeight } = $("stage");
    renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    renderer.setSize(clientWidth, clientHeight, false);
    view.resize(clientWidth, clientHeight);
    strips();
    touch();
  }
  new ResizeObserver(resize).observe($("stage"));
  document.addEventListener("visibilitychange", touch);
  $("view").addEventListener("webglcontextrestored", touch);

  function draw(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
    last = now;
    if (playing && end > 0 && passed) {
      const next = time + passed * Number($("speed").value), around = next > end;
      seek(next % end);
      jumped = around;
    }
    if (stale) {
      stale = false;
      who.pose(time, ghost);
      view.go(jumped ? undefined : passed);
      jumped = false;
      view.keep();
      who.root(0, spot);
      sun.target.position.set(take.worlds > 1 ? 0 : spot.x, take.worlds > 1 ? 0 : spot.y, 0);
      sun.position.copy(sun.target.position).add(new THREE.Vector3(4, -6, 11));
      renderer.render(scene, view.camera);
      if (playing) stale = true;
    }
    requestAnimationFrame(draw);
  }
  who.pose(0, "");
  seek(take.start);
  resize();
  view.begin();
  if (take.worlds > 1) follow(false);
  heed();
  requestAnimationFrame(draw);
})();
