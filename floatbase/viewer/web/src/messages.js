// Messages that the pages and the notebook's widget show instead of a picture.

export const CLOSED =
  "The viewer was closed or its kernel was restarted. To show it again, run its cell again.";

export const RETIRED =
  "This viewer is live in a newer output. Run this cell again to show it here.";

export const NO_WEBGL =
  "This 3-D picture needs WebGL, which this browser does not have or has switched off. Switch on " +
  "hardware acceleration in the browser's settings and restart it, or open the page in another " +
  "browser.";

export const TOO_OLD =
  "This browser is too old to open the 3-D picture. Use Chrome or Edge 92, Firefox 113, " +
  "Safari 16.4, or a newer version.";

export const WAITING = "The 3-D picture appears here. If it does not, run its cell.";
