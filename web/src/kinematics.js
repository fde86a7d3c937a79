// Frames of a chain or tree: each joint has a constant pose in its parent's frame (-1: the base),
// then turns about or slides along its own z.
import { Matrix4 } from 'three';

export class Chain {
  constructor(joints) {
    this.joints = joints.map(({ revolute, parent, before }) => ({
      revolute,
      parent,
      before: new Matrix4().set(...before),
    }));
    this.stands = joints.map(() => new Matrix4());
    this.frames = joints.map(() => new Matrix4());
    this.motion = new Matrix4();
  }

  /** Place all frames; `stands` contains the joints' poses before their own motion. */
  place(q) {
    this.joints.forEach(({ revolute, parent, before }, j) => {
      if (parent >= 0) this.stands[j].multiplyMatrices(this.frames[parent], before);
      else this.stands[j].copy(before);
      if (revolute) this.motion.makeRotationZ(q[j]);
      else this.motion.makeTranslation(0, 0, q[j]);
      this.frames[j].multiplyMatrices(this.stands[j], this.motion);
    });
    return this.frames;
  }
}
