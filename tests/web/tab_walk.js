() => {
    if (window.outcropTab) return;
    let count = 0;
    const numbers = new WeakMap();
    const number = (e) => { if (!numbers.has(e)) numbers.set(e, (count += 1)); return numbers.get(e); };
    const says = (e) => {
        const words = (e.getAttribute('aria-label') || e.textContent || e.getAttribute('placeholder') || '').trim();
        return `${e.tagName.toLowerCase()}${e.dataset.testid ? '#' + e.dataset.testid : ''} ${words.slice(0, 50)}`;
    };
    const scope = () => document.querySelector('dialog[open]') ?? document;
    const shown = (e) => e.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true })
        && e.getClientRects().length > 0;
    const INTERACTIVE = 'button, a[href], input, select, textarea, summary, [tabindex], [role=button], [role=tab],'
        + ' [role=radio], [role=slider], [role=separator], [role=application]';
    const interactive = () => [...scope().querySelectorAll(INTERACTIVE)].filter((e) =>
        shown(e) && !e.matches(':disabled') && !(e.tabIndex < 0 && !e.parentElement?.closest('[data-roving]')));
    const listens = (e) => {
        if (e.outcropPointer) return true;
        const held = Object.getOwnPropertySymbols(e).find((s) => s.description === 'events');
        return held !== undefined && ['click', 'dblclick', 'mousedown', 'pointerdown', 'wheel'].some((t) => t in e[held]);
    };
    /** How many of the four sides of the outline are not cut off by what scrolls or clips round the element. */
    const sides = (e, style) => {
        const r = e.getBoundingClientRect();
        const far = Math.max(0, parseFloat(style.outlineOffset) + parseFloat(style.outlineWidth) / 2);
        let box = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };
        for (let up = e.parentElement; up !== null; up = up.parentElement) {
            const s = getComputedStyle(up);
            if (s.overflowX === 'visible' && s.overflowY === 'visible') continue;
            const b = up.getBoundingClientRect();
            box = { left: Math.max(box.left, b.left), top: Math.max(box.top, b.top),
                right: Math.min(box.right, b.right), bottom: Math.min(box.bottom, b.bottom) };
        }
        return [r.left - far >= box.left, r.top - far >= box.top, r.right + far <= box.right, r.bottom + far <= box.bottom]
            .filter(Boolean).length;
    };
    const covered = (e) => {
        // A text in an editor is longer than the part that is shown.
        const r = (e.closest('.cm-scroller') ?? e).getBoundingClientRect();
        const [x, y] = [r.left + r.width / 2, r.top + r.height / 2];
        if (x < 0 || y < 0 || x >= innerWidth || y >= innerHeight) return 'out of sight';
        const top = document.elementFromPoint(x, y);
        if (top === null || e.contains(top) || top.contains(e) || top.closest('label')?.contains(e)) return '';
        return e.labels !== undefined && [...(e.labels ?? [])].some((l) => l.contains(top)) ? '' : `under ${says(top)}`;
    };
    const at = () => {
        const e = document.activeElement;
        if (e === null || e === document.body || e === document.documentElement) return null;
        const style = getComputedStyle(e);
        const seen = e.matches(':focus-visible') && style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 1
            && !/rgba\(.*, 0\)|transparent/.test(style.outlineColor) && sides(e, style) >= 2;
        const part = e.closest('[data-part]');
        const parts = [...document.querySelectorAll('[data-part]')];
        return {
            id: number(e), says: says(e), seen, hidden: e.tagName === 'DIALOG' ? '' : covered(e),
            part: part === null ? -1 : parts.indexOf(part),
            roving: e.closest('[data-roving]')?.dataset.roving ?? '',
            group: e.closest('[data-roving]')?.getAttribute('aria-label') ?? '',
            radio: e.type === 'radio' ? e.name || 'radio' : '',
        };
    };
    const names = (elements) => {
        axe.setup(document.documentElement);
        const found = elements.map((e) => axe.commons.text.accessibleText(e).trim());
        axe.teardown();
        return found;
    };
    window.outcropTab = {
        at,
        begin: () => { document.activeElement?.blur?.(); (scope() === document ? interactive()[0] : scope())?.focus(); },
        all: () => {
            const found = interactive();
            const called = names(found);
            return found.map((e, k) => ({
                id: number(e), says: says(e), name: called[k], positive: e.tabIndex > 0,
                group: e.closest('[data-roving]')?.getAttribute('aria-label') ?? '',
                radio: e.type === 'radio' ? e.name || 'radio' : '',
            }));
        },
        pointerOnly: () => [...scope().querySelectorAll('*')].filter((e) => listens(e) && shown(e)).filter((e) => {
            for (let up = e; up !== null; up = up.parentElement) {
                if (up.tabIndex >= 0 && up !== document.body) return false;
                if (up.matches('.cm-editor')) return false;  // its margins and lines: the keys of the text in it
                if (up.closest('[data-roving]') && up.matches('button, [role=tab], [role=radio]')) return false;
                if (up.matches('label, :disabled, button')) return false;
            }
            return true;
        }).map((e) => says(e)),
    };
}
