// The robot in three dimensions. Its state is set from outside: show(q), highlight(axes), sweep(qs).
import {
  AmbientLight, Color, CylinderGeometry, DirectionalLight, DoubleSide, GridHelper, Group, InstancedMesh, LineBasicMaterial,
  LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, NotEqualStencilFunc, PerspectiveCamera, Quaternion, ReplaceStencilOp, Scene,
  Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { Chain } from './kinematics.js';
import { box, capsule, edges, mark, mesh, range } from './shapes.js';

const THEMES = {
  light: { ground: '#f5f7fa', link: '#8a97a6', line: '#9aa5b1', grid: '#cbd2d9', axis: '#b44d12', box: '#a3191f', mesh: '#aab4bf' },
  dark: { ground: '#11161c', link: '#8593a3', line: '#7b8794', grid: '#323f4b', axis: '#ffab70', box: '#ff8080', mesh: '#9fb0c0' },
};
const ROOM = 1.08; // share of the picture about the links
const DIRECTIONS = { oblique: [1, -1.1, 0.7], front: [1, 0, 0.05], side: [0, -1, 0.05], top: [0.01, 0, 1] };

// Links are drawn in full also inside their swept volume: their pixels are marked.
const MARKED = { stencilWrite: true, stencilRef: 1, stencilZPass: ReplaceStencilOp };
const NOT_OVER_LINKS = { stencilWrite: true, stencilRef: 1, stencilFunc: NotEqualStencilFunc };

export class RobotView {
  constructor(host, { robot, workspace = null, label = robot.name }) {
    this.robot = robot;
    this.workspace = workspace;
    this.chain = new Chain(robot.joints);
    this.up = new Vector3(...robot.up);
    this.host = host;
    this.sweeps = [];
    this.highlighted = new Set();
    this.close = { link: -1, box: -1 };
    this.dark = false;
    this.frames = 0;
    this._open(label);
    this._build();
    this.show(robot.joints.map(({ lower, upper }) => Math.min(Math.max(0, lower), upper)));
    this.look('oblique');
    this.theme(false);
    new ResizeObserver(() => this._fit()).observe(host);
  }

  /** Set the configuration [rad or m]. */
  show(q) {
    this.q = Array.from(q);
    const frames = this.chain.place(this.q);
    frames.forEach((frame, j) => {
      this._place(this.links[j], frame);
      this._place(this.marks[j], frame);
      this._place(this.ranges[j], this.chain.stands[j]);
    });
    this._draw();
  }

  /** Mark the measured axes, from 0. */
  highlight(axes) {
    this.highlighted = new Set(axes);
    this._colour();
  }

  /** Mark the link and the box, from 0, with the smallest distance; -1 for none. */
  nearest(link, number) {
    if (link === this.close.link && number === this.close.box) return;
    this.close = { link, box: number };
    this._colour();
  }

  /** Show the volume swept by the links at configurations qs; an empty list shows none. */
  sweep(qs) {
    for (const each of this.sweeps) {
      this.swept.remove(each);
      each.dispose();
    }
    this.sweeps = [];
    if (qs.length) this._sweep(qs);
    this.show(this.q);
  }

  /** Draw a line from a point of the robot to the pulling point; without points none. */
  pull(from, to) {
    this.pulled.visible = Boolean(from);
    if (from) {
      const way = to.clone().sub(from);
      this.pulled.position.copy(from).addScaledVector(way, 0.5);
      this.pulled.scale.set(1, way.length(), 1);
      this.pulled.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), way.normalize());
    }
    this._draw();
  }

  /** Show or hide a part: links, meshes, boxes, limits, swept. */
  toggle(part, visible) {
    for (const each of this._parts(part)) each.visible = visible;
    this._draw();
  }

  /** Move the camera back until all links are in the picture, unless the user has moved it. */
  contain() {
    this.contains = true; // in a picture of another shape, too
    if (this.moved) return;
    const { camera, controls } = this;
    camera.updateMatrixWorld();
    const high = Math.tan((camera.fov * Math.PI) / 360);
    const back = this.robot.joints.flatMap(({ capsule: { ends, radius } }, j) => ends.map((end) => {
      const { x, y, z } = new Vector3(...end).applyMatrix4(this.chain.frames[j]).applyMatrix4(camera.matrixWorldInverse);
      const beside = Math.max((Math.abs(y) + radius) / high, (Math.abs(x) + radius) / (high * camera.aspect));
      return ROOM * beside + z;
    }));
    const by = Math.max(...back);
    if (by <= 0) return;
    camera.position.addScaledVector(camera.position.clone().sub(controls.target).normalize(), by);
    controls.update();
  }

  /** Look at the whole robot from a side: oblique, front, side, top. */
  look(from) {
    this.moved = false;
    const { middle, size } = this._extent();
    const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), this.up);
    const way = new Vector3(...DIRECTIONS[from]).normalize().applyQuaternion(turn);
    const narrow = Math.min(1, this.camera.aspect);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(way, (2.1 * size) / narrow);
    this.controls.update();
    this._draw();
  }

  /** Turn the view by angles about the vertical and about the horizontal [rad]; zoom by a factor. */
  orbit(across, upwards, nearer = 1) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const sideways = new Vector3().crossVectors(this.up, offset).normalize();
    const angle = offset.angleTo(this.up);
    offset.applyAxisAngle(this.up, across);
    offset.applyAxisAngle(sideways.applyAxisAngle(this.up, across), Math.min(Math.max(-upwards, 0.02 - angle), Math.PI - 0.02 - angle));
    this.camera.position.copy(this.controls.target).addScaledVector(offset, 1 / nearer);
    this.controls.update();
    this._draw();
  }

  theme(dark) {
    this.dark = dark;
    this._colour();
  }

  /** Position of the origin of a link's frame, in pixels of the picture from its upper left. */
  project(link) {
    this.camera.updateMatrixWorld();
    const point = new Vector3().setFromMatrixPosition(this.chain.frames[link]).project(this.camera);
    const { width, height } = this.size;
    return { x: ((point.x + 1) / 2) * width, y: ((1 - point.y) / 2) * height };
  }

  /** Matrix from the base frame to the picture, row by row, and the picture's size. */
  seen() {
    this.camera.updateMatrixWorld();
    const m = this.camera.projectionMatrix.clone().multiply(this.camera.matrixWorldInverse);
    return { matrix: m.transpose().toArray(), ...this.size };
  }

  _open(label) {
    this.renderer = new WebGLRenderer({ antialias: true, stencil: true });
    const { domElement } = this.renderer;
    domElement.tabIndex = 0;
    domElement.setAttribute('role', 'img');
    domElement.setAttribute('aria-label', `${label} in three dimensions; arrow keys turn the view, plus and minus zoom`);
    this.host.append(domElement);
    this.camera = new PerspectiveCamera(40, 1, 0.01, 500);
    this.camera.up.copy(this.up);
    this.controls = new OrbitControls(this.camera, domElement);
    this.controls.addEventListener('change', () => this._draw());
    this.controls.addEventListener('start', () => { this.moved = true; });
    domElement.addEventListener('keydown', (event) => this._key(event));
    this._fit();
  }

  _key(event) {
    const by = {
      ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1], '+': [0, 0, 1.15], '-': [0, 0, 1 / 1.15],
    }[event.key];
    if (!by) return;
    this.moved = true;
    this.orbit(...by);
    event.preventDefault();
    event.stopPropagation();
  }

  _build() {
    this.scene = new Scene();
    this.sun = new DirectionalLight('#ffffff', 2.2);
    this.scene.add(new AmbientLight('#ffffff', 1.3), this.sun);
    this.materials = {
      grid: new LineBasicMaterial(), limit: new LineBasicMaterial(), marked: new LineBasicMaterial(),
      pulled: new MeshBasicMaterial({ depthTest: false }),
      link: new MeshLambertMaterial(MARKED), measured: new MeshLambertMaterial(MARKED), near: new MeshLambertMaterial(MARKED),
      mesh: new MeshLambertMaterial({ side: DoubleSide, ...MARKED }),
      hidden: new MeshBasicMaterial({ colorWrite: false, ...NOT_OVER_LINKS }),
      swept: new MeshBasicMaterial({ transparent: true, opacity: 0.25, depthWrite: false, ...NOT_OVER_LINKS }),
    };
    this._buildRobot();
    const thick = 0.008 * this.robot.reach;
    this.pulled = new Mesh(new CylinderGeometry(thick, thick, 1, 8), this.materials.pulled);
    this.pulled.visible = false;
    this.pulled.renderOrder = 4;
    this.scene.add(this.pulled);
    this._buildBoxes();
    this._buildGrid();
  }

  _buildRobot() {
    const { joints, meshes = [] } = this.robot;
    this.capsules = joints.map((joint) => new Mesh(capsule(joint.capsule, 2), this.materials.link));
    this.links = joints.map((_, j) => fixed(new Group().add(this.capsules[j])));
    this.rough = joints.map((joint) => capsule(joint.capsule));
    const radius = (joint) => Math.max(1.4 * joint.capsule.radius, 0.06);
    this.ranges = joints.map((joint) => fixed(new LineSegments(range(joint, radius(joint)), this.materials.limit)));
    this.marks = joints.map((joint) => fixed(new LineSegments(mark(radius(joint)), this.materials.limit)));
    this.limits = new Group().add(...this.ranges, ...this.marks);
    this.meshes = meshes.map((each) => {
      const shown = new Mesh(mesh(each), this.materials.mesh);
      (each.link < 0 ? this.scene : this.links[each.link]).add(shown);
      return shown;
    });
    this.swept = new Group();
    this.scene.add(...this.links, this.limits, this.swept);
    const covered = new Set(meshes.map(({ link }) => link));
    this.capsules.forEach((each, j) => { each.visible = !covered.has(j); });
  }

  _buildBoxes() {
    this.boxFaces = [];
    this.boxes = new Group();
    for (const each of this.workspace?.boxes ?? []) {
      const shape = box(each);
      const faces = new Mesh(shape, new MeshBasicMaterial({ transparent: true, opacity: 0.13, depthWrite: false, side: DoubleSide }));
      const rim = edges(shape, new LineBasicMaterial());
      this.boxFaces.push({ faces, rim });
      this.boxes.add(faces, rim);
    }
    this.scene.add(this.boxes);
  }

  _buildGrid() {
    const grid = new GridHelper(4 * Math.max(this.robot.reach, this._extent().size), 16);
    grid.material.dispose();
    grid.material = this.materials.grid;
    grid.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), this.up);
    this.scene.add(grid);
  }

  _extent() {
    const { reach, joints } = this.robot;
    const far = this.chain.frames.map(({ elements: e }) => Math.hypot(e[12], e[13], e[14]));
    const radius = Math.max(...joints.map(({ capsule: { radius: each } }) => each));
    const wanted = Math.max(1.3 * (Math.max(...far) + 2 * radius), 0.3 * reach);
    const size = Math.max(Math.min(wanted, reach), 4 * radius);
    return { middle: this.up.clone().multiplyScalar(0.12 * size), size };
  }

  _parts(part) {
    return { links: this.capsules, meshes: this.meshes, boxes: [this.boxes], limits: [this.limits], swept: [this.swept] }[part];
  }

  _sweep(qs) {
    const places = qs.map((q) => this.chain.place(q).map((frame) => frame.clone()));
    this.robot.joints.forEach((_, link) => {
      const moved = places.some((frames) => !frames[link].equals(places[0][link]));
      if (!moved) return;
      // first the depth alone, so that overlapping capsules look like one volume
      for (const material of [this.materials.hidden, this.materials.swept]) {
        const each = new InstancedMesh(this.rough[link], material, qs.length);
        places.forEach((frames, i) => each.setMatrixAt(i, frames[link]));
        each.frustumCulled = false;
        each.renderOrder = material === this.materials.hidden ? 2 : 3;
        this.sweeps.push(each);
        this.swept.add(each);
      }
    });
  }

  _place(object, matrix) {
    object.matrix.copy(matrix);
    object.matrixWorldNeedsUpdate = true;
  }

  _colour() {
    const theme = THEMES[this.dark ? 'dark' : 'light'];
    this.scene.background = new Color(theme.ground);
    const { materials } = this;
    const colours = { pulled: 'box', grid: 'grid', limit: 'line', marked: 'axis', link: 'link', measured: 'axis', near: 'box', mesh: 'mesh', swept: 'axis' };
    for (const [name, colour] of Object.entries(colours)) materials[name].color.set(theme[colour]);
    this.capsules.forEach((each, j) => {
      each.material = j === this.close.link ? materials.near : this.highlighted.has(j) ? materials.measured : materials.link;
      this.ranges[j].material = this.marks[j].material = this.highlighted.has(j) ? materials.marked : materials.limit;
    });
    this.boxFaces.forEach(({ faces, rim }, i) => {
      faces.material.color.set(theme.box);
      faces.material.opacity = i === this.close.box ? 0.35 : 0.13;
      rim.material.color.set(theme.box);
    });
    this._draw();
  }

  _fit() {
    const { clientWidth: width, clientHeight: height } = this.host;
    this.size = { width: Math.max(width, 1), height: Math.max(height, 1) };
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(this.size.width, this.size.height);
    this.camera.aspect = this.size.width / this.size.height;
    this.camera.updateProjectionMatrix();
    if (this.contains) this.contain();
    if (this.scene) this._draw();
  }

  _draw() {
    if (this.due) return;
    this.due = requestAnimationFrame(() => {
      this.due = 0;
      this.sun.position.copy(this.camera.position).addScaledVector(this.up, this.robot.reach);
      this.renderer.render(this.scene, this.camera);
      this.frames += 1;
    });
  }
}

function fixed(object) {
  object.matrixAutoUpdate = false;
  return object;
}
