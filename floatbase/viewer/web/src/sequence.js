// The frames between a kernel and a page: each has the number after the one before it.

// What a widget knows of the page in its frame. It begins as lost, until the page says hello.
export function createSequence() {
  let received = 0, drawn = 0, isLost = true;
  return {
    isLost: () => isLost,
    // The page has loaded, or will be loaded anew: what still comes is an earlier page's.
    lose() { isLost = true; },
    begin() {
      received = drawn = 0;
      isLost = false;
    },
    // The number of the frame that the page has drawn now.
    nextDrawn: () => ++drawn,
    // What to do with a frame of this number: "draw"; "skip", where it is of an earlier connection;
    // or "reload", where one got lost, so that all it said must come again.
    receive(number) {
      if (isLost) return "skip";
      if (number !== received + 1) return received ? "reload" : "skip";
      received = number;
      return "draw";
    },
  };
}
