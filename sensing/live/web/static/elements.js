"use strict";
// Elements of the page by their id, and words in them.
const $ = (id) => document.getElementById(id);

// Text is written where it changed: a screen reader does not say the same 25 times a second.
function write(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}
