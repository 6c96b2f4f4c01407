// Declarations of our own with the shape of Arduino's, as far as the library uses them.
#pragma once
#include <stddef.h>
#include <stdint.h>
unsigned long millis(void);
unsigned long micros(void);
class Print {
 public:
  virtual size_t write(uint8_t byte) = 0;
  virtual size_t write(const uint8_t* data, size_t size) = 0;
  size_t print(const char* text);
  size_t print(double number, int digits = 2);
  size_t println(const char* text);
};
class Stream : public Print {
 public:
  virtual int available() = 0;
  virtual int read() = 0;
};
class HardwareSerial : public Stream {
 public:
  void begin(unsigned long baud);
  size_t write(uint8_t byte) override;
  size_t write(const uint8_t* data, size_t size) override;
  int available() override;
  int read() override;
};
extern HardwareSerial Serial, Serial1;
