// What overflows can be reached by the keyboard; then what the page carries (web/src/report.js) is opened.
'use strict';
const scrolling = () => {
  for (const each of document.querySelectorAll('.wide, .panels > div')) {
    if (each.scrollWidth > each.clientWidth) each.tabIndex = 0;
    else each.removeAttribute('tabindex');
  }
};
addEventListener('resize', scrolling);
scrolling();
(async () => {
  const packed = document.getElementById('view');
  if (!packed) return;
  const bytes = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
  const script = document.createElement('script');
  script.textContent = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).json();
  document.body.append(script);
  hilView.report();
})();
