const viewer = new Viewer(document.getElementById("turn"));
if (viewer.gl)
  viewer.load(Uint8Array.from(atob(document.getElementById("glb").textContent), (c) => c.charCodeAt(0)).buffer);
else {
  document.getElementById("note").textContent = "This browser has no WebGL 2: the pictures below show the same.";
  document.querySelector(".knobs").style.display = "none";
}
document.getElementById("pull").addEventListener("input", (event) => viewer.set({ pull: event.target.value / 100 }));
document.getElementById("cut").addEventListener("change", (event) => viewer.set({ cut: event.target.checked }));
document.getElementById("group").addEventListener("change", (event) => viewer.set({ group: event.target.value }));
