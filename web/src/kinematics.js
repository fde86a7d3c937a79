// Frames of a chain: each joint has a constant pose in the previous frame, then turns about or
// slides along its own z.
import { Matrix4 } from 'three';

export class Chain {
  constructor(joints) {
    this.joints = joints.map(({ revolute, before }) => ({
      revolute,
      before: new Matrix4().set(...before),
    }));
    this.stands = joints.map(() => new Matrix4());
    this.frames = joints.map(() => new Matrix4());
    this.motion = new Matrix4();
  }

  /** Place all frames; `stands` contains the joints' poses before their own motion. */
  place(q) {
    let last = null;
    this.joints.forEach(({ revolute, before }, j) => {
      if (last) this.stands[j].multiplyMatrices(last, before);
      else this.stands[j].copy(before);
      if (revolute) this.motion.makeRotationZ(q[j]);
      else this.motion.makeTranslation(0, 0, q[j]);
      last = this.frames[j].multiplyMatrices(this.stands[j], this.motion);
    });
    return this.frames;
  }
}
