// The wipe between two maps: as much of the first one is seen as the slider says.
for (const wipe of document.querySelectorAll('.wipe')) {
  const slider = wipe.querySelector('input');
  const show = () => wipe.style.setProperty('--at', slider.value + '%');
  slider.addEventListener('input', show);
  show();
}
