// What the bundle offers: the page of hil view, that of a run that goes on, and the robot alone for other pages.
export { follow } from './live.js';
export { open } from './page.js';
export { RobotView } from './robot_view.js';
