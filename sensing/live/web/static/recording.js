"use strict";
// What is being recorded, and the files of this run; and the moment of a recording that is replayed.
const Recording = (() => {
  const KINDS = ["full", "half", "none"]; // of pictures, in the order of the choice
  let kind = null;

  const gigabytes = (mb) => (mb > 2000 ? `${(mb / 1000).toFixed(0)} GB` : `${mb} MB`);
  const clock = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

  function size(now) {
    const left = now.minutes_left > 120 ? `${Math.round(now.minutes_left / 60)} h` : `${now.minutes_left} min`;
    const lost = now.lost ? `, ${now.lost} lost to a slow disk` : "";
    const disk = `${now.size_mb} MB, ${now.mb_per_min} MB/min, ${gigabytes(now.free_mb)} free (${left})`;
    return `${now.name}: ${clock(now.seconds)}, ${disk}, ${now.frames} frames${lost}`;
  }

  function link(name, k) {
    const words = { href: `recording/${k}`, download: name, textContent: `Download ${name}` };
    return Object.assign(document.createElement("a"), words);
  }

  function draw(now) {
    $("record").classList.toggle("on", now.on);
    write("record", now.on ? "Stop recording" : "Start recording");
    $("pictures").disabled = now.on;
    if (kind !== now.pictures) {
      kind = now.pictures;
      $("pictures").value = KINDS.indexOf(kind);
    }
    $("note_form").hidden = !now.on;
    $("record_said").classList.toggle("bad", now.failed);
    write("record_note", !now.on ? "" : now.name ? size(now) : now.note);
    write("record_said", now.on ? "" : now.note);
    $("recording").hidden = !now.note && !now.files.length;
    if ($("files").children.length !== now.files.length) $("files").replaceChildren(...now.files.map(link));
  }
  return { draw };
})();

const Replay = (() => {
  const SEEK_MS = 200; // while the slider is drawn along, the newest moment goes out as often as this at most
  let sought = null;

  function draw(now) {
    $("replay").hidden = now === null;
    if (now === null) return;
    const moment = `${now.position_s.toFixed(1)} of ${now.span_s.toFixed(1)} s`;
    write("play", now.paused ? "Play" : "Pause");
    if ($("seek").max !== String(now.span_s)) $("seek").max = now.span_s;
    if (sought === null) $("seek").value = now.position_s;
    $("seek").setAttribute("aria-valuetext", moment.replace(" of ", " s of "));
    write("moment", moment);
    if (document.activeElement !== $("loop")) $("loop").checked = now.loop;
    const exact = "from its begin: the recording's own numbers";
    write("whole", now.whole ? exact : "sent here: started anew a second before, not to the bit");
  }

  // go: takes the newest moment, s.
  function seek(go) {
    if (sought === null)
      setTimeout(() => {
        const moment = sought;
        sought = null;
        go(moment);
      }, SEEK_MS);
    sought = +$("seek").value;
  }
  return { draw, seek };
})();
