// Calls a function after the messages that wait, without the pause that timers have.

export function soonCaller(act) {
    const { port1, port2 } = new MessageChannel();
    let isDue = false;
    port1.onmessage = () => {
        isDue = false;
        act();
    };
    return () => {
        if (isDue) return;
        isDue = true;
        port2.postMessage(null);
    };
}
