// Before the other scripts, in words that every browser knows. Until they have run, long tables are short: what is taken
// out again need not be laid out. Where they do not run, everything is shown, with a note.
document.documentElement.className = "starting";
window.addEventListener("error", function (event) {
  document.documentElement.className = document.documentElement.className.replace("starting", "");
  var message = document.getElementById("scene-message");
  if (!message || window.scenePage) return;
  message.hidden = false;
  message.textContent = "The motion cannot be shown: the script of this page does not run in this browser (" +
    event.message + "). Everything else on the page is complete.";
});
