// The wipe between two maps: as much of the first one is seen as the slider says.
for (const wipe of document.querySelectorAll('.wipe')) {
  const slider = wipe.querySelector('input');
  const show = () => wipe.style.setProperty('--at', slider.value + '%');
  slider.addEventListener('input', show);
  show();
}

// A table or chart that is wider than its place says so, until its end is seen.
for (const scroll of document.querySelectorAll('.scroll')) {
  const hint = scroll.previousElementSibling;
  const show = () => {
    const wider = scroll.scrollWidth > scroll.clientWidth + 2;
    const more = wider && scroll.scrollLeft + scroll.clientWidth < scroll.scrollWidth - 2;
    scroll.classList.toggle('more', more);
    if (hint && hint.classList.contains('hint')) hint.classList.toggle('shown', wider);
  };
  scroll.addEventListener('scroll', show, { passive: true });
  new ResizeObserver(show).observe(scroll);
  show();
}
// Charts as files: their text gets the colour of paper's ink.
for (const svg of document.querySelectorAll('.chart svg')) {
  const block = svg.closest('.block');
  const button = document.createElement('button');
  button.className = 'export';
  button.type = 'button';
  button.textContent = 'SVG';
  button.title = 'Save this chart as an SVG file';
  button.addEventListener('click', () => {
    const copy = svg.cloneNode(true);
    copy.setAttribute('xmlns', 'http://www.w3.org/2000/svg');
    copy.setAttribute('color', '#1d2126');
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([copy.outerHTML], { type: 'image/svg+xml' }));
    const title = block.querySelector('h3').textContent;
    link.download = title.toLowerCase().replace(/[^a-z0-9]+/g, '-').replace(/^-|-$/g, '') + '.svg';
    link.click();
    URL.revokeObjectURL(link.href);
  });
  block.append(button);
}
