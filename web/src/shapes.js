// Shapes of links, boxes, limits and meshes, without motion.
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, EdgesGeometry, LineSegments, Matrix4,
  Quaternion, Vector3,
} from 'three';
import { unpack } from './packed.js';

const Y = new Vector3(0, 1, 0);

/** A capsule in its link's frame. */
export function capsule({ ends, radius }, fineness = 1) {
  const [a, b] = ends.map((end) => new Vector3(...end));
  const way = b.clone().sub(a);
  const length = way.length();
  const shape = new CapsuleGeometry(radius, length, 4 * fineness, 12 * fineness);
  const turn = new Quaternion().setFromUnitVectors(Y, length > 0 ? way.normalize() : Y);
  const middle = a.add(b).multiplyScalar(0.5);
  return shape.applyMatrix4(new Matrix4().compose(middle, turn, new Vector3(1, 1, 1)));
}

/** A visual mesh in its link's frame. */
export function mesh({ vertices, triangles }) {
  const shape = new BufferGeometry();
  shape.setAttribute('position', new BufferAttribute(Float32Array.from(unpack(vertices)), 3));
  shape.setIndex(new BufferAttribute(Uint32Array.from(unpack(triangles)), 1));
  shape.computeVertexNormals();
  return shape;
}

/** Faces of a box. */
export function box({ low, high }) {
  const size = high.map((h, i) => h - low[i]);
  const middle = high.map((h, i) => (h + low[i]) / 2);
  return new BoxGeometry(...size).translate(...middle);
}

export const edges = (shape, material) => new LineSegments(new EdgesGeometry(shape), material);

/** Range of a joint in its moving frame: an arc, or a path along z, with a mark at q. */
export function range({ revolute, lower, upper }, radius) {
  const point = revolute
    ? (q) => [radius * Math.cos(q), radius * Math.sin(q), 0]
    : (q) => [radius, 0, q];
  const span = revolute ? Math.min(upper - lower, 2 * Math.PI) : upper - lower;
  const n = revolute ? Math.max(2, Math.ceil(span / 0.1)) : 1;
  const points = [];
  for (let k = 0; k < n; k++) {
    points.push(...point(lower + (span * k) / n), ...point(lower + (span * (k + 1)) / n));
  }
  for (const end of [lower, lower + span]) {
    const [x, y, z] = point(end);
    points.push(0.8 * x, 0.8 * y, z, 1.2 * x, 1.2 * y, z);
  }
  return lines(points);
}

/** The mark of a joint's position on its range, at q = 0. */
export const mark = (radius) => lines([0.25 * radius, 0, 0, 1.3 * radius, 0, 0]);

function lines(points) {
  return new BufferGeometry().setAttribute(
    'position', new BufferAttribute(new Float32Array(points), 3),
  );
}
