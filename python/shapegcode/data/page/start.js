// Before the other scripts, in words that every browser knows: says so where they do not run.
window.addEventListener("error", function (event) {
  var message = document.getElementById("scene-message");
  if (!message || window.scenePage) return;
  message.hidden = false;
  message.textContent = "The motion cannot be shown: the script of this page does not run in this browser (" +
    event.message + "). Everything else on the page is complete.";
});
