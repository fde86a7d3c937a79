// Curves of recorded or planned motion: position, velocity, torque beside the predicted one,
// distance.
import { Curve } from './curves.js';

const LEAST = 0.02; // minimum span of a torque scale as a share of the torque limit, so that noise does not fill the scale

/** Draw curves into a host; a click on one calls seek(t), a drag zoom([begin, end]), a double click zoom(). */
export function curvesOf(host, { robot: { joints }, workspace, prediction }, recorded, seek, zoom) {
  const line = (track, name, colour, rest = {}) => ({
    name, colour, value: (t) => track.at(t)[0], instants: (...span) => track.instants(...span), ...rest,
  });
  const { planned, measured, velocity, torque, predicted, band, distance } = recorded;
  const setPoint = measured ? 'set-point' : 'planned';
  const motion = (of, rate) => (j) => [
    ...(of ? [line(of[j], 'measured', '--measured')] : []),
    ...(planned ? [line(planned[j], setPoint, '--planned', { dashed: Boolean(measured), value: (t) => planned[j].at(t)[rate] })] : []),
  ];
  const add = (title, lines, rest) => new Curve(host, { title, lines, seek, zoom, ...rest });
  const within = (j) => (band ? { band: (t) => band[j].at(t)[0] } : {});
  const found = [];
  if (torque || predicted) {
    found.push(add((j) => `axis ${j + 1}: ${word(joints[j])}, ${joints[j].torque_unit}`, (j) => [
      ...(torque ? [line(torque[j], 'measured', '--measured')] : []),
      // dashed and on top, so that equal curves are both visible
      ...(predicted ? [line(predicted[j], prediction, '--planned', { dashed: Boolean(torque), ...within(j) })] : []),
    ], { bounds: (j) => both(joints[j].torque), least: (j) => LEAST * (joints[j].torque ?? 0) }));
  }
  if (torque && predicted) {
    const left = (j) => ({ value: (t) => torque[j].at(t)[0] - predicted[j].at(t)[0] });
    found.push(add((j) => `axis ${j + 1}: measured − predicted, ${joints[j].torque_unit}`, (j) => [
      line(predicted[j], band ? '95 %' : '', '--planned', { dashed: true, value: (t) => 0 * predicted[j].at(t)[0], ...within(j) }),
      line(predicted[j], '', '--measured', left(j)),
    ], { least: (j) => (LEAST / 2) * (joints[j].torque ?? 0) }));
  }
  if (measured || planned) {
    const [limits, speeds] = [(j) => [joints[j].lower, joints[j].upper], (j) => both(joints[j].velocity)];
    found.push(
      add((j) => `axis ${j + 1}: position, ${joints[j].unit}`, motion(measured, 0), { bounds: limits }),
      add((j) => `axis ${j + 1}: velocity, ${joints[j].unit}/s`, motion(velocity, 1), { bounds: speeds }),
    );
  }
  if (distance) {
    found.push(add(() => 'nearest distance of a link to a box, m', () => [line(distance.track, 'distance', '--measured')], { bounds: () => [workspace.margin] }));
  }
  return found;
}

const word = ({ torque_unit: unit }) => (unit === 'N' ? 'force' : 'torque');

function both(limit) {
  return limit ? [-limit, limit] : [];
}
