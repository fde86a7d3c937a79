// What the bundle offers: the page of hil view, and the robot alone for other pages.
export { RobotView } from './robot_view.js';
export { inflate } from './packed.js';
export { open } from './page.js';
