// The page of a run that goes on: lines of the run come as events, and a stop goes back.
import { LivePage } from './live_page.js';

const AGAIN = 5000; // until a page that was refused tries anew [ms]

/** Show the run that serves this page; `window.live` then answers what tests ask. */
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
