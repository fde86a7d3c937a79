// What the bundle offers: the page of hil view, that of a run that goes on, and what reports carry.
export { follow } from './live.js';
export { open } from './page.js';
export { report } from './report.js';
