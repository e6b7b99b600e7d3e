// Replays a trace of card memory in DRAMsim3 as fast as the memory takes it, with a limited number of reads in flight, and prints what came of
// it: lines, nanoseconds from the first request to the last answer, reads that met an open row, and picojoules.
//
//   replay CONFIG FOLDER IN_FLIGHT <TRACE      lines of the trace: 0xADDRESS READ CYCLE; the cycles are not waited for
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>

#include "json.hpp"
#include "memory_system.h"

namespace {

// Cycles without an answer after which the memory is taken to hang.
const uint64_t PATIENCE = 1000000;

[[noreturn]] void fail(const std::string& message) {
    std::cerr << "replay: " << message << std::endl;
    std::exit(1);
}

// Sum of a counter over the channels.
double sum(const nlohmann::json& channels, const char* name) {
    double total = 0;
    for (const auto& channel : channels) total += channel.at(name).get<double>();
    return total;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) fail("usage: replay CONFIG FOLDER IN_FLIGHT <TRACE");
    const std::string folder = argv[2];
    const uint64_t most = std::strtoull(argv[3], nullptr, 10);
    if (most == 0) fail("IN_FLIGHT is a number of transactions, at least 1");

    uint64_t issued = 0, answered = 0, clock = 0, last = 0;
    auto answer = [&](uint64_t) { ++answered; last = clock; };
    dramsim3::MemorySystem memory(argv[1], folder, answer, answer);

    std::ios::sync_with_stdio(false);
    std::string address, operation, cycle;
    bool is_waiting = false, has_ended = false;
    while (!has_ended || answered < issued) {
        if (!has_ended && !is_waiting) {
            is_waiting = static_cast<bool>(std::cin >> address >> operation >> cycle);
            has_ended = !is_waiting;
            if (is_waiting && operation != "READ" && operation != "WRITE") fail("no line of a trace: " + address + " " + operation + " " + cycle);
        }
        if (is_waiting && issued - answered < most) {
            const uint64_t place = std::strtoull(address.c_str(), nullptr, 16);
            const bool is_write = operation == "WRITE";
            if (memory.WillAcceptTransaction(place, is_write)) {
                memory.AddTransaction(place, is_write);
                ++issued;
                is_waiting = false;
            }
        }
        memory.ClockTick();
        if (++clock > last + PATIENCE) fail("the memory does not answer");
    }
    memory.PrintStats();

    std::ifstream file(folder + "/dramsim3.json");
    const auto statistics = nlohmann::json::parse(file);
    const double done = sum(statistics, "num_reads_done") + sum(statistics, "num_writes_done");
    if (done != static_cast<double>(issued)) fail("DRAMsim3 counts other transactions than it was given");
    std::cout << issued << ' ' << static_cast<double>(last) * memory.GetTCK() << ' '
              << sum(statistics, "num_read_row_hits") << ' ' << sum(statistics, "total_energy") << std::endl;
}
