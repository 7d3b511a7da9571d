// What the pages and the notebook's widget say in place of a picture.

export const CLOSED = "The viewer is closed, or its kernel was restarted: run its cell again.";

export const RETIRED =
  "This viewer is live in a newer output. Run this cell again to have it here.";

export const NO_WEBGL =
  "This 3-D picture needs WebGL, which this browser does not have or has switched off. Switch on " +
  "hardware acceleration in the browser's settings and restart it, or open the page in another " +
  "browser.";

export const TOO_OLD =
  "This browser is too old to open the 3-D picture. Open it in a current one: Chrome or Edge " +
  "from 92, Firefox from 113, Safari from 16.4.";

export const WAITING = "The 3-D picture comes here. Where it does not, run its cell.";
