"use strict";
// What states, warnings and colours mean, in plain words.
const Words = (() => {
  const flags = {
    camera_misfit:
      "the camera does not sit as assumed: calibrate it (the state names the command); " +
      "the band is wider by what that may change",
    dots_disturbed: "some dots look otherwise than in the reference: glint, dirt, lamp, or a torn picture",
    moved: "camera or lens have moved since the reference: zero again when untouched",
    zeroed_under_load: "the dots move as if the reference had been taken under load: zero again when untouched",
    compressed: "the video repeats parts of its pictures (H.264, HEVC, MPEG-4, VP9): record MJPEG or a lossless video",
    mixed:
      "the camera mixes each picture with those before and shows fast presses late: " +
      "switch its noise reduction over time off",
    dots_missing: "too few dots are in the reference: free and wipe lens and dome, then zero again",
    overexposed: "the reference is white in part: less light, then zero again",
    dark: "the reference is dark: more light, then zero again",
    low_resolution: "the pictures are too small: choose a larger mode",
    unconfirmed: "the force stepped within one frame and some dots were unsure: the next frame decides",
    out_of_range: "more force or tilt than the model was trained on: a guess",
    dots_lost: "many dots are not seen: less is known than usual",
    gain_of_other_weights: "the silicone was weighed with another network: weigh again",
    missing: "the model gave no number for this frame",
    late: "a frame came late and was passed over",
    stale: "no newer frame: the last value is held",
    blind: "too few dots are seen to say anything",
    damaged: "the picture is damaged",
    frozen: "the same picture again and again",
    wrong_size: "the picture has another size than the reference",
  };
  const states = {
    starting: "no frame yet",
    zeroing: "the reference is being taken: leave the endcap untouched",
    "waiting for a reference": "no reference could be taken; the reason stands beside it",
    running: "all is well",
    degraded: "numbers count, with a warning",
    blind: "black, covered or foreign picture: no number",
    "damaged pictures": "the decoder complains: no number",
    "wrong size": "the camera's mode was changed: no number",
    frozen: "the camera repeats one picture: no number",
    silent: "no frame comes: no number",
    unplugged: "the camera is gone; it is opened again every half second",
    failed: "an error of the program: no number",
    ended: "the file is at its end: the last numbers",
  };
  const colours = {
    "green to red circle": "a dot, and how well its surroundings match the reference",
    "blue cross": "a dot that is lost; where it is expected",
    "yellow arrow": "shear field: how the skin has moved, enlarged",
    "orange arrow": "force on the endcap, its tip where it acts",
    "violet arrow, two heads": "torque about the endcap's origin (right hand)",
    "light blue arrow": "the part of the force along the surface",
    "orange lamp or dome": "touched",
    "gray dome": "no number",
    "shaded band": "two standard deviations either way",
    "pressed dome":
      "its shape under the measured force against a plane, from solved presses of the design (depth and patch); " +
        "between patch and rim it is a sketch",
  };

  function list(title, words) {
    const box = document.createElement("div");
    const heading = document.createElement("h2");
    const rows = document.createElement("dl");
    heading.textContent = title;
    for (const [name, meaning] of Object.entries(words))
      for (const [kind, words] of [
        ["dt", name],
        ["dd", meaning],
      ])
        rows.appendChild(document.createElement(kind)).textContent = words;
    box.append(heading, rows);
    return box;
  }
  function show(element) {
    element.replaceChildren(list("Colours and signs", colours), list("States", states), list("Warnings", flags));
  }
  // Of a list of flags, for a person; an unknown one as it is.
  function plain(names) {
    return (names || []).map((name) => (flags[name] ? `${name} (${flags[name]})` : name)).join("; ");
  }
  return { show, plain, flags, states };
})();
