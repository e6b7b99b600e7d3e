// The service worker of a page that has its own host: the page works without a network after its first load, and asks nobody else.

const NAME = "photoncard-VERSION";

// Names may have signs that have a meaning in an address.
const addressOf = file => file.split("/").map(encodeURIComponent).join("/");

self.addEventListener("install", event => event.waitUntil((async () => {
    const cache = await caches.open(NAME);
    const files = await (await fetch("files.json", { cache: "no-store" })).json();
    await cache.addAll(files.map(file => new Request(addressOf(file), { cache: "no-cache" })));
    await self.skipWaiting();
})()));

self.addEventListener("activate", event => event.waitUntil((async () => {
    for (const name of await caches.keys()) {
        if (name !== NAME && name.startsWith("photoncard-")) await caches.delete(name);
    }
    await self.clients.claim();
})()));

self.addEventListener("fetch", event => {
    if (event.request.method !== "GET" || new URL(event.request.url).origin !== location.origin) return;
    event.respondWith((async () => await (await caches.open(NAME)).match(event.request, { ignoreSearch: true }) ?? fetch(event.request))());
});
