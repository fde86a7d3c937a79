// The page of a running measurement: lines of the run arrive as events, and a stop request is sent
// back.
import { LivePage } from './live_page.js';

const AGAIN = 5000; // time until a refused page tries again [ms]

/** Show the run that serves this page; `window.live` then answers questions of tests. */
export function follow() {
  const page = new LivePage();
  window.live = page;
  listen(page);
}

function listen(page) {
  const source = new EventSource('events');
  source.onmessage = ({ data }) => {
    page.take(JSON.parse(data));
    if (page.ended) source.close();
  };
  source.onerror = () => {
    page.disconnected();
    if (source.readyState === EventSource.CLOSED) setTimeout(() => listen(page), AGAIN);
  };
}
