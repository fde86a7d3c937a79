// Exports of the bundle: the page of hil view, the page of a running measurement, and scripts of
// reports.
export { follow } from './live.js';
export { open } from './page.js';
export { report } from './report.js';
