// The frames between a kernel and a page, which are numbered consecutively.

// What a widget knows about the page in its frame. The page counts as lost until it says hello.
export function createSequence() {
  let received = 0, drawn = 0, isLost = true;
  return {
    isLost: () => isLost,
    // The page has loaded, or will be reloaded: frames that still arrive belong to an earlier page.
    lose() { isLost = true; },
    begin() {
      received = drawn = 0;
      isLost = false;
    },
    // The number of the frame that the page has drawn now.
    nextDrawn: () => ++drawn,
    // What to do with a frame of this number: "draw"; "skip" if it is from an earlier connection;
    // or "reload" if a frame was lost, so that its content must be sent again.
    receive(number) {
      if (isLost) return "skip";
      if (number !== received + 1) return received ? "reload" : "skip";
      received = number;
      return "draw";
    },
  };
}
